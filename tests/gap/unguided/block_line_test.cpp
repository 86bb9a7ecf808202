#include "gap/unguided/block_line.h"

#include <vector>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

// y = 3 + 0.5 (i - 2) on X, a constant on Y, and -1 1 -1 1 0 on Z.
TEST(BlockLine, MeanSlopeAndSquaresAboutTheLine) {
  const std::vector<Eigen::Vector3d> readings = {
      {2, 7, -1}, {2.5, 7, 1}, {3, 7, -1}, {3.5, 7, 1}, {4, 7, 0}};
  const BlockLine line = line_through(readings);
  EXPECT_NEAR(line.mean[0], 3, 1e-12);
  EXPECT_NEAR(line.slope[0], 0.5, 1e-12);
  EXPECT_NEAR(line.square[0], 0, 1e-12);
  EXPECT_NEAR(line.mean[1], 7, 1e-12);
  EXPECT_NEAR(line.slope[1], 0, 1e-12);
  // Z: mean 0; sum of (i - 2) z = 2 - 1 + 0 + 1 + 0 = 2, over 10; squares 4 - 2 * 2 / 10.
  EXPECT_NEAR(line.slope[2], 0.2, 1e-12);
  EXPECT_NEAR(line.square[2], 4 - 0.4, 1e-12);
}

}  // namespace
}  // namespace sixpoint::gap
