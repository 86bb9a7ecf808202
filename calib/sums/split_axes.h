// The axes of samples, each behind itself: what sums over one axis run on.
//
//   const std::vector<std::array<std::int16_t, 3>> samples = {{1, 2, 3}, {4, 5, 6}};
//   std::vector<std::int16_t> x(2), y(2), z(2);
//   split_axes(samples, x.data(), y.data(), z.data());  // {1, 4}, {2, 5}, {3, 6}
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace sixpoint::calib {

// Each of x, y and z has room for samples.size() counts.
void split_axes(std::span<const std::array<std::int16_t, 3>> samples, std::int16_t* x,
                std::int16_t* y, std::int16_t* z);

}  // namespace sixpoint::calib
