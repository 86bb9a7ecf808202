#include "station/run/jig_watch.h"

#include <gmock/gmock.h>

#include "expect_result.h"
#include "mocks/inert/inert.h"

namespace sixpoint::station {
namespace {

using device::Pose;
using testing::ElementsAre;
using testing::HasSubstr;

using Refusal = JigAction::Refusal;

JigAction judged(JigAction::Kind kind, Pose pose, Refusal refusal = Refusal::other) {
  return {kind, pose, "tilted by 7 degrees", refusal};
}

device::JigPosition standing_at(Pose pose) {
  device::JigPosition position;
  position.pose = pose;
  return position;
}

TEST(JigWatch, AJigThatAPersonTurnsIsAskedNothing) {
  mocks::InertJig jig;
  jig.by_itself = false;
  jig.next_position = fail(ErrorCode::io, "asked");
  JigWatch watch({});
  EXPECT_OK(watch.ask(jig, 0));
  EXPECT_OK(watch.compare(jig, judged(JigAction::Kind::accepted, Pose::plus_x)));
  EXPECT_OK(JigWatch::place(jig, Pose::plus_x, JigPhase::measuring));
  EXPECT_THAT(jig.poses, ElementsAre(Pose::plus_x));
}

TEST(JigWatch, AsksForFaultsAtMostOnceAPeriodAndTurnsNothingAfterOne) {
  mocks::InertJig jig;
  JigWatch watch({0.25, 3});
  EXPECT_OK(watch.ask(jig, 10));
  jig.next_position->fault = "the door is open";
  EXPECT_OK(watch.ask(jig, 10.2));
  EXPECT_FAILS(watch.ask(jig, 10.25), ErrorCode::device_unavailable);
  EXPECT_FAILS(JigWatch::place(jig, Pose::plus_x, JigPhase::measuring),
               ErrorCode::device_unavailable);
  EXPECT_TRUE(jig.poses.empty());
}

TEST(JigWatch, SaysWhereTheJigStands) {
  mocks::InertJig jig;
  JigWatch watch({0.25, 3});
  EXPECT_EQ(*watch.ask(jig, 10), std::nullopt);
  jig.next_position = standing_at(Pose::minus_y);
  EXPECT_EQ(*watch.ask(jig, 10.2), std::nullopt) << "its last answer";
  EXPECT_EQ(*watch.ask(jig, 10.3), Pose::minus_y);
  jig.by_itself = false;
  EXPECT_EQ(*watch.ask(jig, 11), std::nullopt) << "a person turns it";
}

TEST(JigWatch, AJigThatCannotTurnAboutTheVerticalIsNotMovedForIt) {
  mocks::InertJig jig;
  EXPECT_FALSE(jig.can_half_turn());
  EXPECT_FAILS(JigWatch::place(jig, Pose::plus_x, JigPhase::turning), ErrorCode::usage);
  EXPECT_TRUE(jig.poses.empty());
}

// The table in jig_watch.h, a row each.
TEST(JigWatch, RowFaultSpoilsThePlacement) {
  mocks::InertJig jig;
  jig.next_position = standing_at(Pose::plus_x);
  jig.next_position->fault = "stopped by its button";
  JigWatch watch({});
  EXPECT_FAILS(watch.compare(jig, judged(JigAction::Kind::accepted, Pose::plus_x)),
               ErrorCode::device_unavailable);
}

TEST(JigWatch, RowItDoesNotKnow) {
  mocks::InertJig jig;
  JigWatch watch({});
  EXPECT_OK(watch.compare(jig, judged(JigAction::Kind::accepted, Pose::plus_x)));
}

TEST(JigWatch, RowAnotherPose) {
  for (const auto& [kind, refusal] : {std::pair{JigAction::Kind::accepted, Refusal::other},
                                      std::pair{JigAction::Kind::refused, Refusal::tilted},
                                      std::pair{JigAction::Kind::refused, Refusal::unwanted}}) {
    mocks::InertJig jig;
    jig.next_position = standing_at(Pose::minus_y);
    JigWatch watch({});
    const Status status = watch.compare(jig, judged(kind, Pose::plus_x, refusal));
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::bad_data);
    EXPECT_THAT(status.error().what, HasSubstr("stands at -y and the unit reads +x"));
  }
}

TEST(JigWatch, RowsThisPose) {
  mocks::InertJig jig;
  jig.next_position = standing_at(Pose::plus_x);
  JigWatch watch({0.25, 3});
  const JigAction good = judged(JigAction::Kind::accepted, Pose::plus_x);
  const JigAction tilted = judged(JigAction::Kind::refused, Pose::plus_x, Refusal::tilted);
  const JigAction unwanted = judged(JigAction::Kind::refused, Pose::plus_x, Refusal::unwanted);
  const JigAction elsewhere = judged(JigAction::Kind::refused, Pose::minus_z);
  for (const JigAction& action :
       {good, tilted, tilted, unwanted, elsewhere, good, tilted, unwanted, tilted}) {
    EXPECT_OK(watch.compare(jig, action)) << "a good placement between them begins the count anew";
  }
  const Status third = watch.compare(jig, tilted);
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::bad_data);
  EXPECT_THAT(third.error().what, HasSubstr("tilted by 7 degrees time after time"));
}

}  // namespace
}  // namespace sixpoint::station
