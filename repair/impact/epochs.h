// What studies compute from a recording, epoch by epoch: ENMO, MAD and activity counts.
//
//   SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, "unit.gt3x"));
//   SIXPOINT_ASSIGN(const EpochSeries series, epochs_of(recording, {}));
//   series.epochs.front().enmo_mg;
//
//     ENMO = mean of max(r - 1 g, 0)       (van Hees et al. 2013)
//     MAD  = mean of |r - mean of r|       (Vaha-Ypya et al. 2015)
//
// with r the magnitude of a sample and the means over the recorded samples of the epoch. Epochs
// begin at the first sample and every epoch_s from there, by the file's own clock; before it as
// well, where the clock was set back. Missing seconds are filled for the counts' filter as the
// vendor's CSV fills them (fills_gap(); the last sample again, zeros while on USB). Where they are
// not, and where the clock leaps, the filter begins anew, and what it lacks of the epochs on both
// sides is filled with the nearest sample. Where the clock comes back into an epoch that it left,
// its counts are the sums of the two parts; ENMO and MAD, about the mean of each part, are weighed
// by samples. An epoch without a recorded sample, and one that the recording ends within, is left
// out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "gt3x/recording.h"
#include "repair/impact/activity_counts.h"

namespace sixpoint::repair {

struct EpochOptions {
  int epoch_s = 5;  // of GGIR, and of most published cut points for ENMO
  CountFilter filter = CountFilter::normal;
};

struct Epoch {
  std::uint32_t unix_time = 0;  // of its beginning, by the file's clock
  std::uint32_t samples = 0;    // recorded ones
  double enmo_mg = 0;
  double mad_mg = 0;
  // How much the two change with an error of each axis that is the same in all samples: mg per mg.
  // The error of an axis comes from its constants, so it stays over an epoch and over a recording.
  PerAxis<double> enmo_per_error{};
  PerAxis<double> mad_per_error{};
  PerAxis<int> counts{};  // 0 where the series has none
};

struct EpochSeries {
  std::string path;
  int epoch_s = 0;
  double rate_hz = 0;
  bool has_counts = false;    // false for a rate that the counts do not know
  std::vector<Epoch> epochs;  // in order of time
};

// The largest recording: 400 days of epochs of a second would be 34 million.
inline constexpr std::size_t kMostEpochs = 4'000'000;

// usage for an epoch that is no whole number of seconds from 1 to 3600; bad_data for raw counts
// (.agdc), for a recording without a rate, a scale or a sample, and beyond kMostEpochs.
Result<EpochSeries> epochs_of(gt3x::Recording& recording, const EpochOptions& options);

}  // namespace sixpoint::repair
