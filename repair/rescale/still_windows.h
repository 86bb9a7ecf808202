// How far what is written is from 1 g, at the moments when the input was still.
//
//   WindowError error(256);       // LSB/g
//   error.expect({300, 120});     // windows in order, at the latest when their end has passed
//   error.push(samples);          // a record of them, again and again
//   const std::vector<StillWindow> windows = {{300, 120}};
//   const std::optional<double> left_mg = error.mean_mg(windows);
//
// A repair compares two states of the same seconds, so it takes the windows that the survey found
// (calib/still_blocks.h) and does not look for others. The survey may find them as the samples
// pass: the last kLongestWindow of these wait until all windows that hold them are known.
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
  // Twice a still block of the paper (4 s) at 1000 Hz.
  static constexpr std::size_t kLongestWindow = std::size_t{1} << 13;

  explicit WindowError(double accel_scale_lsb_per_g)
      : accel_scale_lsb_per_g_(accel_scale_lsb_per_g) {}

  // Of the samples from here on; no window may hold samples of two scales.
  void set_scale(double accel_scale_lsb_per_g);

  // Windows in order, none within another. One that ends before the samples of the last push() did
  // must not be longer than kLongestWindow.
  void expect(const StillWindow& window) { windows_.push_back({window, std::nullopt}); }

  // The samples that follow those of the call before.
  void push(std::span<const gt3x::Counts> samples);

  // Behind the last samples: mean of |magnitude of the window's mean - 1 g|, over those of these
  // windows, in order, that were expected and are complete; nothing where none is.
  std::optional<double> mean_mg(std::span<const StillWindow> windows);

 private:
  void judge(std::span<const gt3x::Counts> samples);

  struct Judged {
    StillWindow window;
    std::optional<double> error_mg;
  };
  std::vector<Judged> windows_;
  double accel_scale_lsb_per_g_;
  std::vector<gt3x::Counts> waiting_;  // pushed, and not judged yet
  std::uint64_t judged_ = 0;           // samples
  std::size_t next_ = 0;               // window that is not complete
  PerAxis<std::int64_t> sum_{};        // of its samples so far
};

}  // namespace sixpoint::repair
