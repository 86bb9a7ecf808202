// Activity counts of one axis, as the vendor's software makes them of raw samples.
//
//   ActivityCounts axis(100, 5, CountFilter::normal);  // 100 Hz, epochs of 5 s
//   if (const auto count = axis.push(0.98)) {          // g, sample by sample
//     counts.push_back(*count);                        // an epoch is complete
//   }
//
// Neishabouri et al., "Quantification of acceleration as activity counts in ActiGraph wearables",
// Scientific Reports 12, 11958 (2022): the samples are brought to 30 Hz (zeros between, a low pass
// of first order, every M-th value; rounded to 0.001 g, half away from zero), go through a band
// pass (IIR, 0.29 to 1.63 Hz), are scaled by 17.127, their amount is cut off at 128 and set to 0
// below 4, rounded down; the mean of three, rounded down, is a value at 10 Hz, and these are added
// up over the epoch. The low frequency extension keeps amounts from 1 on, those below 4 less 1.
//
// Checked against the vendor's own counts of the same recordings: equal in all 540 epochs at 90 Hz
// with the extension; at 100 Hz within 3 counts of an epoch.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace sixpoint::repair {

enum class CountFilter : std::uint8_t { normal, low_frequency_extension };

class ActivityCounts {
 public:
  // The rates that the vendor's units have: 30 to 100 Hz in steps of 10. Others have no counts.
  static bool knows(double rate_hz);

  // `rate_hz` is one that it knows; epoch_s at least 1.
  ActivityCounts(int rate_hz, int epoch_s, CountFilter filter);

  // The sample that follows the one before. The counts of the epoch that it completes.
  std::optional<int> push(double g);

 private:
  static constexpr std::size_t kTaps = 8;
  double band_pass(double value);
  int rectified(double filtered) const;
  std::optional<int> add_at_30_hz(double value);

  int up_;    // zeros are put in so that the rate is this many times as high,
  int down_;  // of which every so-manieth value is kept
  bool low_pass_;
  CountFilter filter_;
  int values_per_epoch_;
  int phase_ = 0;  // values at the high rate until the next one that is kept
  double last_in_ = 0;
  double last_out_ = 0;
  bool settled_ = false;  // the band pass has seen the first value for long
  std::array<double, kTaps> in_{};
  std::array<double, kTaps> out_{};
  int sum_of_three_ = 0;
  int of_three_ = 0;
  int sum_ = 0;
  int of_epoch_ = 0;
};

}  // namespace sixpoint::repair
