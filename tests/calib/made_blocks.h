// Still blocks as the finder makes them of the recording of a synthetic unit, with noise.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "calib/scaling.h"
#include "calib/still_blocks.h"
#include "expect_result.h"
#include "synthetic_unit.h"

namespace sixpoint::tests {

// A unit under the wrong filter: stored constants off by 0.1 to 0.2 g and 5 to 20 %.
inline SyntheticUnit mismatched(unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> gain(0.80, 0.95);
  std::uniform_real_distribution<double> shift(0.1, 0.2);
  std::uniform_int_distribution<int> near(-12, 12);
  std::bernoulli_distribution sign(0.5);
  SyntheticUnit unit;
  for (std::size_t a = 0; a < 3; ++a) {
    const int half = 250 + near(random);
    unit.zero[a] = 3 * near(random);
    unit.positive[a] = unit.zero[a] + half + near(random) / 4;
    unit.negative[a] = unit.positive[a] - 2 * half;
    unit.counts_per_g[a] = half * gain(random);
    unit.zero_counts[a] = unit.zero[a] + (sign(random) ? 1 : -1) * shift(random) * half;
  }
  return unit;
}

struct Wearing {
  double rate_hz = 30;
  double seconds = 60;
  double wobble_deg = 0;
  double warming_c = 0;  // from the first to the last pose
};

inline std::vector<calib::StillBlock> blocks_of(const SyntheticUnit& unit,
                                                const std::vector<Vector>& poses,
                                                const Wearing& how, unsigned seed) {
  std::mt19937_64 random(seed);
  const auto reversal = calib::Reversal::make({unit.positive, unit.negative, unit.zero},
                                              unit.accel_scale, calib::RecordWidth::bits12);
  EXPECT_OK(reversal);
  auto finder = calib::StillBlockFinder::make(*reversal, how.rate_hz);
  EXPECT_OK(finder);
  double time = 0;
  Vector before = poses.front();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Vector pose = how.wobble_deg > 0 ? wobbled(poses[i], how.wobble_deg, random) : poses[i];
    const double warm = how.warming_c * static_cast<double>(i) /
                        static_cast<double>(std::max<std::size_t>(1, poses.size() - 1));
    for (const auto& samples : {turning(unit, before, pose, 3, how.rate_hz, random),
                                at_rest(unit, pose, how.seconds, how.rate_hz, random, warm)}) {
      finder->push(time, samples);
      time += static_cast<double>(samples.size()) / how.rate_hz;
    }
    before = pose;
  }
  return finder->finish();
}

}  // namespace sixpoint::tests
