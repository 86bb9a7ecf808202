#include "repair/rescale/still_windows.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sixpoint::repair {

WindowError::WindowError(std::vector<StillWindow> windows, double accel_scale_lsb_per_g)
    : windows_(std::move(windows)), accel_scale_lsb_per_g_(accel_scale_lsb_per_g) {}

void WindowError::push(std::span<const gt3x::Counts> samples) {
  const std::uint64_t end = pushed_ + samples.size();
  while (next_ < windows_.size() && windows_[next_].first_sample < end) {
    const StillWindow& window = windows_[next_];
    const std::uint64_t window_end =
        window.first_sample + static_cast<std::uint64_t>(window.samples);
    const std::uint64_t from = std::max(window.first_sample, pushed_);
    const std::uint64_t to = std::min(window_end, end);
    for (const gt3x::Counts& sample : samples.subspan(from - pushed_, to - from)) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        sum_[a] += sample[a];
      }
    }
    if (window_end > end) {
      break;
    }
    const double count_per_g = accel_scale_lsb_per_g_ * window.samples;
    const double magnitude_g = std::hypot(static_cast<double>(sum_[0]) / count_per_g,
                                          static_cast<double>(sum_[1]) / count_per_g,
                                          static_cast<double>(sum_[2]) / count_per_g);
    sum_of_errors_mg_ += kMgPerG * std::abs(magnitude_g - 1);
    sum_ = {};
    ++next_;
  }
  pushed_ = end;
}

std::optional<double> WindowError::mean_mg() const {
  return next_ == 0 ? std::nullopt : std::optional(sum_of_errors_mg_ / static_cast<double>(next_));
}

}  // namespace sixpoint::repair
