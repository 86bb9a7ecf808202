// How far what is written is from 1 g, at the moments when the input was still.
//
//   const std::vector<StillWindow> windows = {{0, 120}, {300, 120}};
//   WindowError error(windows, 256);  // LSB/g
//   error.push(samples);              // a record of them, again and again
//   const std::optional<double> left_mg = error.mean_mg();
//
// A repair compares two states of the same seconds, so it takes the windows that the survey found
// (calib/still_blocks.h) and does not look for others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/measure.h"
#include "gt3x/log/samples.h"

namespace sixpoint::repair {

struct StillWindow {
  std::uint64_t first_sample = 0;  // counted over all samples of the recording
  int samples = 0;
};

class WindowError {
 public:
  // Windows in order, none within another.
  WindowError(std::vector<StillWindow> windows, double accel_scale_lsb_per_g);

  // Of the samples from here on; no window may hold samples of two scales.
  void set_scale(double accel_scale_lsb_per_g) { accel_scale_lsb_per_g_ = accel_scale_lsb_per_g; }

  // The samples that follow those of the call before.
  void push(std::span<const gt3x::Counts> samples);

  // Mean of |magnitude of the window's mean - 1 g|, over the windows that are complete; nothing
  // where none is.
  std::optional<double> mean_mg() const;

 private:
  std::vector<StillWindow> windows_;
  double accel_scale_lsb_per_g_;
  std::uint64_t pushed_ = 0;
  std::size_t next_ = 0;         // window that is not complete
  PerAxis<std::int64_t> sum_{};  // of its samples so far
  double sum_of_errors_mg_ = 0;
};

}  // namespace sixpoint::repair
