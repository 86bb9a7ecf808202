#include "device/jig.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

// The six names of docs/devices/motorised-jig.md, each with its axis and sign.
TEST(Jig, PosesHaveNamesAxesAndSigns) {
  struct Row {
    Pose pose;
    const char* name;
    PerAxis<double> up_g;
  };
  const std::vector<Row> rows = {
      {Pose::plus_x, "+x", {1, 0, 0}}, {Pose::minus_x, "-x", {-1, 0, 0}},
      {Pose::plus_y, "+y", {0, 1, 0}}, {Pose::minus_y, "-y", {0, -1, 0}},
      {Pose::plus_z, "+z", {0, 0, 1}}, {Pose::minus_z, "-z", {0, 0, -1}},
  };
  for (const Row& row : rows) {
    EXPECT_EQ(to_string(row.pose), row.name);
    EXPECT_EQ(*parse_pose(row.name), row.pose);
    EXPECT_EQ(direction_of(row.pose), row.up_g);
    EXPECT_EQ(pose_of(axis_of(row.pose), sign_of(row.pose)), row.pose);
  }
  for (const char* name : {"", "x", "+w", "+x ", "+X"}) {
    EXPECT_FAILS(parse_pose(name), ErrorCode::usage);
  }
}

TEST(Jig, AManualJigWaitsForAPerson) {
  ManualJig jig;
  EXPECT_FALSE(jig.turns_by_itself());
  ASSERT_OK(jig.go_to(Pose::plus_x));
  EXPECT_FALSE(jig.position()->pose) << "it does not know where the unit is";
  EXPECT_EQ(jig.position()->fault, "");
  ASSERT_OK(jig.stop());
}

// Oracle: jig.h. What the jig says comes from outside: it is shown without its control characters.
TEST(Jig, AStopAFaultOrASilentJigIsTheAnswerOfTheCheck) {
  mocks::InertJig jig;
  EXPECT_OK(check_jig(jig));
  jig.next_position->fault = "door\x1b[2J";
  const Status stopped = check_jig(jig);
  EXPECT_FAILS(stopped, ErrorCode::device_unavailable);
  EXPECT_EQ(stopped.error().what, "the jig stopped: door\\x1b[2J");
  EXPECT_EQ(stopped.error().where, "inert");
  jig.next_position = fail(ErrorCode::bad_data, "the jig's state cannot be", "jig", "switch it");
  EXPECT_FAILS(check_jig(jig), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::device
