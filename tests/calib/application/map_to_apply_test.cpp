#include "calib/application/map_to_apply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sixpoint::calib {
namespace {

ConstantsRecord with_map(bool verified, int directions, double matrix_mg, double six_mg) {
  ConstantsRecord record;
  record.cross_axis.emplace();
  record.cross_axis->verified = verified;
  record.cross_axis->unseen_directions = directions;
  record.cross_axis->unseen_mg = matrix_mg;
  record.cross_axis->six_unseen_mg = six_mg;
  return record;
}

TEST(MapToApply, FollowsTheTable) {
  struct Row {
    ConstantsRecord record;
    bool cross_axis;
    const char* said;
  };
  const Row rows[] = {
      {ConstantsRecord(), false, ""},
      {with_map(false, 60, 4, 8), false, "not verified"},
      {with_map(true, 2, 4, 8), false, "not tested"},
      {with_map(true, 60, 7.5, 8), false, "not applied"},
      {with_map(true, 60, 4, 8), true, "4.0 mg with them, 8.0 mg with six"},
  };
  for (const Row& row : rows) {
    const MapChoice choice = map_to_apply(row.record);
    EXPECT_EQ(choice.cross_axis, row.cross_axis) << row.said;
    EXPECT_THAT(choice.why, testing::HasSubstr(row.said));
    EXPECT_EQ(choice.why.empty(), !row.record.cross_axis) << row.said;
  }
}

}  // namespace
}  // namespace sixpoint::calib
