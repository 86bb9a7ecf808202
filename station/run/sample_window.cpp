#include "station/run/sample_window.h"

#include <algorithm>
#include <cmath>

namespace sixpoint::station {

bool SampleWindow::add(const device::RawCounts& counts) {
  recent_.push_back(counts);
  const bool over = recent_.size() > size_;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    repeats_[axis] = counts[axis] == last_[axis] ? repeats_[axis] + 1 : 0;
    const std::int64_t in = counts[axis];
    const std::int64_t out = over ? recent_.front()[axis] : 0;
    sum_[axis] += in - out;
    sum_square_[axis] += in * in - out * out;
  }
  last_ = counts;
  if (over) {
    recent_.pop_front();
  }
  return recent_.size() == size_;
}

void SampleWindow::clear() {
  recent_.clear();
  sum_ = {};
  sum_square_ = {};
}

PerAxis<double> SampleWindow::mean_lsb() const {
  PerAxis<double> mean_lsb{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    mean_lsb[axis] = static_cast<double>(sum_[axis]) / static_cast<double>(recent_.size());
  }
  return mean_lsb;
}

PerAxis<double> SampleWindow::sd_lsb() const {
  PerAxis<double> sd_lsb{};
  const auto n = static_cast<double>(recent_.size());
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto sum = static_cast<double>(sum_[axis]);
    const double variance =
        (static_cast<double>(sum_square_[axis]) - sum * sum / n) / std::max(1.0, n - 1);
    sd_lsb[axis] = std::sqrt(std::max(0.0, variance));
  }
  return sd_lsb;
}

}  // namespace sixpoint::station
