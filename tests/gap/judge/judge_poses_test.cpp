#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::Made;

TEST(JudgePoses, ADwellThatLiesElsewhereIsNamed) {
  Made made(tests::made_production({}));
  EXPECT_FALSE(judge_poses(made.bundle, made.clean).wrong);
  // Dwell 7 reads 0.5 g on x more than its pose and any gain and offset allow.
  for (std::size_t i = 7000; i < 8000; ++i) {
    made.clean.samples[i][0] = static_cast<std::int16_t>(made.clean.samples[i][0] + 128);
  }
  const PoseCheck check = judge_poses(made.bundle, made.clean);
  EXPECT_TRUE(check.wrong);
  EXPECT_FALSE(check.moving);
  ASSERT_EQ(check.found.alarms.size(), 1U);
  EXPECT_NE(check.found.alarms[0].where.find("segment 7"), std::string::npos);
}

TEST(JudgePoses, DwellsThatMoveEndTheDiagnosis) {
  Made made(tests::made_production({}));
  for (std::size_t i = 0; i < 5000; ++i) {
    if (i % 1000 > 700) {
      made.clean.samples[i][1] = static_cast<std::int16_t>(made.clean.samples[i][1] + 64);
    }
  }
  EXPECT_TRUE(judge_poses(made.bundle, made.clean).moving) << "five of eighteen, by 0.18 g";
}

}  // namespace
}  // namespace sixpoint::gap
