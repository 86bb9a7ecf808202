#include "station/capture/sides_to_repeat.h"

#include <gmock/gmock.h>

namespace sixpoint::station {
namespace {

using device::Pose;
using testing::ElementsAre;
using testing::IsEmpty;

// The table of the header, row by row.
TEST(SidesToRepeat, FollowsTheTable) {
  calib::SolveReport good;
  good.calibration.emplace();
  good.verification.verified = true;
  ASSERT_TRUE(good.usable());
  EXPECT_THAT(sides_to_repeat(good, 0, 2), IsEmpty());

  calib::SolveReport lacking;
  ASSERT_FALSE(lacking.usable());
  lacking.verification.missing_directions = {"-z", "-x", "+z"};
  const auto both = sides_to_repeat(lacking, 0, 2);
  std::vector<Pose> expected;
  for (const Pose side : device::kPoses) {
    if (side == Pose::minus_x || side == Pose::plus_z || side == Pose::minus_z) {
      expected.push_back(side);
    }
  }
  EXPECT_EQ(both, expected);
  EXPECT_EQ(sides_to_repeat(lacking, 1, 2), expected);
  EXPECT_THAT(sides_to_repeat(lacking, 2, 2), IsEmpty());

  lacking.verification.missing_directions.clear();
  EXPECT_THAT(sides_to_repeat(lacking, 0, 2), IsEmpty());
}

}  // namespace
}  // namespace sixpoint::station
