// Sums over neighbouring counts of one axis, from which lines are laid through them.
//
//   const std::vector<std::int16_t> counts(50, 256);
//   const CountSums sums = count_sums(counts);
//   const double mean = static_cast<double>(sums.sum) / 50;
//
// They run over every sample of every recording, so the machine's widest instructions are chosen at
// run time; all sums are exact whole numbers, the same on every machine.
#pragma once

#include <cstdint>
#include <span>

namespace sixpoint::calib {

struct CountSums {
  std::int64_t sum = 0;
  std::int64_t moment = 0;  // of count times its number, the first being 0
  std::int16_t low = 0;     // the smallest count
  std::int16_t high = 0;    // the largest
};
// At least one and at most 60,000 counts.
CountSums count_sums(std::span<const std::int16_t> counts);

std::int64_t sum_of_squares(std::span<const std::int16_t> counts);

// The largest |count - (mean + slope * centred)|, in single precision; `centred` is as long.
float largest_residual(std::span<const std::int16_t> counts, std::span<const float> centred,
                       float mean, float slope);

}  // namespace sixpoint::calib
