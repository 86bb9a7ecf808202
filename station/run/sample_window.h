// Mean and scatter of a unit's last samples, and how often an axis repeats the same count.
//
//   SampleWindow window(100);
//   if (window.add(counts)) {  // full: 100 samples since the last clear()
//     const double z_lsb = window.mean_lsb()[2];
//   }
//
// Counts in LSB. One thread at a time.
#pragma once

#include <cstdint>
#include <deque>

#include "base/measure.h"
#include "device/unit_types.h"

namespace sixpoint::station {

class SampleWindow {
 public:
  explicit SampleWindow(std::size_t size) : size_(size) {}

  bool add(const device::RawCounts& counts);
  void clear();  // forgets the samples, but not the repeats
  bool empty() const { return recent_.empty(); }
  PerAxis<double> mean_lsb() const;
  PerAxis<double> sd_lsb() const;
  // Samples in a row, until now, that were the same as the one before.
  const PerAxis<int>& repeats() const { return repeats_; }

 private:
  std::size_t size_;
  std::deque<device::RawCounts> recent_;
  PerAxis<std::int64_t> sum_{};
  PerAxis<std::int64_t> sum_square_{};
  device::RawCounts last_{};
  PerAxis<int> repeats_{};
};

}  // namespace sixpoint::station
