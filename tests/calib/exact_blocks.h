// Still blocks in closed form: what a synthetic unit reads in given directions, without noise.
#pragma once

#include <vector>

#include "calib/constants.h"
#include "calib/still_blocks.h"
#include "synthetic_unit.h"

namespace sixpoint::tests {

inline const std::vector<Vector> kSixSides = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                              {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};

// The sensor's own constants, and those in the unit's memory.
inline calib::Calibration truth(const SyntheticUnit& unit) {
  calib::Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = 1 / unit.counts_per_g[a];
    out.zero_lsb[a] = unit.zero_counts[a];
  }
  return out;
}

inline calib::Calibration file_constants(const SyntheticUnit& unit) {
  calib::Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = 2.0 / (unit.positive[a] - unit.negative[a]);
    out.zero_lsb[a] = unit.zero[a];
  }
  return out;
}

// A block of 120 samples whose specific force is `g`.
inline calib::StillBlock exact_block(const SyntheticUnit& unit, const Vector& g,
                                     double time_s = 0) {
  const auto& [xy, xz, yz] = unit.cross_axis;
  const Vector mixed = {g[0] + xy * g[1] + xz * g[2], xy * g[0] + g[1] + yz * g[2],
                        xz * g[0] + yz * g[1] + g[2]};
  calib::StillBlock block;
  block.start_time_s = time_s;
  block.samples = 120;
  for (std::size_t a = 0; a < 3; ++a) {
    block.mean_lsb[a] = unit.zero_counts[a] + unit.counts_per_g[a] * mixed[a];
    block.mean_g[a] = file_constants(unit).to_g(a, block.mean_lsb[a]);
    block.sd_lsb[a] = unit.noise_mg / 1000 * unit.counts_per_g[a];
  }
  return block;
}

// `each` blocks in every direction, one direction after the other, 4 s apart.
inline std::vector<calib::StillBlock> exact_blocks(const SyntheticUnit& unit,
                                                   const std::vector<Vector>& directions,
                                                   int each = 1) {
  std::vector<calib::StillBlock> blocks;
  for (const Vector& direction : directions) {
    for (int i = 0; i < each; ++i) {
      blocks.push_back(exact_block(unit, direction, 4.0 * static_cast<double>(blocks.size())));
    }
  }
  return blocks;
}

// The six sides, twelve edges and eight corners of a cube: 26 directions, 35 degrees apart.
inline std::vector<Vector> cube_directions() {
  std::vector<Vector> out;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) {
          out.push_back(unit_vector(x, y, z));
        }
      }
    }
  }
  return out;
}

}  // namespace sixpoint::tests
