// The upper median of some numbers; reorders them.
//
//   std::vector<double> noise_mg = {4.1, 3.9, 30.0};
//   upper_median(noise_mg);  // 4.1
#pragma once

#include <algorithm>
#include <vector>

namespace sixpoint::gap {

//   std::vector<double> levels = {3, 1, 2, 9};
//   upper_median(levels);  // 3
// `values` must not be empty.
template <class T>
T upper_median(std::vector<T>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace sixpoint::gap
