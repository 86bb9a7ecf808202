#include "calib/coverage.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sixpoint::calib {

namespace {

void add(Coverage& coverage, const PerAxis<double>& mean_g) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    if (coverage.blocks == 0) {
      coverage.min_g[a] = mean_g[a];
      coverage.max_g[a] = mean_g[a];
    }
    coverage.min_g[a] = std::min(coverage.min_g[a], mean_g[a]);
    coverage.max_g[a] = std::max(coverage.max_g[a], mean_g[a]);
    const ValueSubset subset = value_subset(mean_g[a]);
    if (subset != ValueSubset::outside) {
      ++coverage.subset_blocks[a][static_cast<std::size_t>(subset)];
    }
  }
  ++coverage.blocks;
}

}  // namespace

ValueSubset value_subset(double value_g) {
  if (!(std::abs(value_g) <= 1.3)) {
    return ValueSubset::outside;
  }
  if (value_g >= 0.7) {
    return ValueSubset::high;
  }
  return value_g <= -0.7 ? ValueSubset::low : ValueSubset::middle;
}

bool Coverage::complete() const { return blocks > 0 && missing_directions().empty(); }

constexpr PerAxis<std::array<const char*, 2>> kSides = {{{"+x", "-x"}, {"+y", "-y"}, {"+z", "-z"}}};

std::vector<std::string> Coverage::missing_directions() const {
  std::vector<std::string> missing;
  for (std::size_t a = 0; a < kAxes; ++a) {
    if (blocks == 0 || !(max_g[a] > kCoverageLimit_g)) {
      missing.emplace_back(kSides[a][0]);
    }
    if (blocks == 0 || !(min_g[a] < -kCoverageLimit_g)) {
      missing.emplace_back(kSides[a][1]);
    }
  }
  return missing;
}

std::vector<std::string> Coverage::covered_directions() const {
  const std::vector<std::string> missing = missing_directions();
  std::vector<std::string> covered;
  for (const auto& sides : kSides) {
    for (const char* side : sides) {
      if (std::ranges::find(missing, side) == missing.end()) {
        covered.emplace_back(side);
      }
    }
  }
  return covered;
}

Coverage coverage_of(std::span<const PerAxis<double>> means_g) {
  Coverage coverage;
  for (const PerAxis<double>& mean_g : means_g) {
    add(coverage, mean_g);
  }
  return coverage;
}

Coverage coverage_of(std::span<const StillBlock> blocks) {
  Coverage coverage;
  for (const StillBlock& block : blocks) {
    add(coverage, block.mean_g);
  }
  return coverage;
}

Coverage coverage_of(std::span<const StillBlock> blocks, const Calibration& calibration) {
  Coverage coverage;
  for (const StillBlock& block : blocks) {
    add(coverage, calibration.to_g(block.mean_lsb));
  }
  return coverage;
}

}  // namespace sixpoint::calib
