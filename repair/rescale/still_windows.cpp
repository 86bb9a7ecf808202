#include "repair/rescale/still_windows.h"

#include <algorithm>
#include <cmath>

namespace sixpoint::repair {

void WindowError::set_scale(double accel_scale_lsb_per_g) {
  if (accel_scale_lsb_per_g == accel_scale_lsb_per_g_) {
    return;
  }
  judge(waiting_);
  waiting_.clear();
  accel_scale_lsb_per_g_ = accel_scale_lsb_per_g;
}

void WindowError::push(std::span<const gt3x::Counts> samples) {
  // Seldom, so that the moving costs little.
  if (waiting_.size() >= 2 * kLongestWindow) {
    const std::size_t known = waiting_.size() - kLongestWindow;
    judge(std::span(waiting_).first(known));
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(known));
  }
  waiting_.insert(waiting_.end(), samples.begin(), samples.end());
}

void WindowError::judge(std::span<const gt3x::Counts> samples) {
  const std::uint64_t end = judged_ + samples.size();
  while (next_ < windows_.size() && windows_[next_].window.first_sample < end) {
    const StillWindow& window = windows_[next_].window;
    const std::uint64_t window_end =
        window.first_sample + static_cast<std::uint64_t>(window.samples);
    const std::uint64_t from = std::max(window.first_sample, judged_);
    const std::uint64_t to = std::min(window_end, end);
    for (const gt3x::Counts& sample : samples.subspan(from - judged_, to - from)) {
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
    windows_[next_].error_mg = kMgPerG * std::abs(magnitude_g - 1);
    sum_ = {};
    ++next_;
  }
  judged_ = end;
}

std::optional<double> WindowError::mean_mg(std::span<const StillWindow> windows) {
  judge(waiting_);
  waiting_.clear();
  double sum_mg = 0;
  std::size_t count = 0;
  auto at = windows_.begin();
  for (const StillWindow& window : windows) {
    at = std::find_if(at, windows_.end(), [&](const Judged& one) {
      return one.window.first_sample >= window.first_sample;
    });
    if (at != windows_.end() && at->window.first_sample == window.first_sample && at->error_mg) {
      sum_mg += *at->error_mg;
      ++count;
    }
  }
  return count == 0 ? std::nullopt : std::optional(sum_mg / static_cast<double>(count));
}

}  // namespace sixpoint::repair
