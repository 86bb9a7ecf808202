// Whether still blocks cover enough directions: the paper's value subsets and its 0.3 g rule.
//
//   const Coverage coverage = coverage_of(blocks);
//   if (!coverage.complete()) {
//     const std::vector<std::string> missing = coverage.missing_directions();  // "+x", "-z" ...
//   }
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "base/measure.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

// Per axis three subsets by the value at the block (paper, Step 2): high (0.7 .. 1.3 g), middle
// (-0.7 .. 0.7), low (-1.3 .. -0.7). Nine in all; a block lies in one subset of every axis.
enum class ValueSubset { high = 0, middle = 1, low = 2, outside = 3 };
inline constexpr std::size_t kSubsetsPerAxis = 3;
ValueSubset value_subset(double value_g);

// Every axis must be exposed to more than this in both directions (paper, Step 2).
inline constexpr double kCoverageLimit_g = 0.3;

struct Coverage {
  PerAxis<double> min_g{};
  PerAxis<double> max_g{};
  PerAxis<std::array<std::size_t, kSubsetsPerAxis>> subset_blocks{};
  std::size_t blocks = 0;

  bool complete() const;
  // The sides on which the unit must still be laid, out of "+x", "-x", "+y", "-y", "+z", "-z":
  // "+x" when no block has x above 0.3 g. Empty when complete.
  std::vector<std::string> missing_directions() const;
  // The other ones.
  std::vector<std::string> covered_directions() const;
};

// Of calibrated means in g, one per block.
Coverage coverage_of(std::span<const PerAxis<double>> means_g);
// Of the blocks as the file's own constants have them, which is the paper's rule ("in the corrupted
// files"), and as other constants have them.
Coverage coverage_of(std::span<const StillBlock> blocks);
Coverage coverage_of(std::span<const StillBlock> blocks, const Calibration& calibration);

}  // namespace sixpoint::calib
