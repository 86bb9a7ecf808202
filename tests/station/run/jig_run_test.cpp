#include "station/run/jig_run.h"

#include <gmock/gmock.h>

#include "station/run/placer.h"

namespace sixpoint::station {
namespace {

using device::kPoses;

// Oracle: closed form of the made readings.
TEST(JigRun, SixPosesInAnyOrderThenVerification) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Placer placer({}, seed);
    std::vector<Pose> order(kPoses.begin(), kPoses.end());
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[placer.random.below(i)]);
    }
    for (const Pose pose : order) {
      placer.place(pose);
    }
    ASSERT_EQ(placer.run.faces().size(), 6U);
    EXPECT_EQ(placer.run.phase(), JigPhase::verifying);
    EXPECT_EQ(placer.count(JigAction::Kind::fit), 1);
    for (const PoseReading& face : placer.run.faces()) {
      const auto direction = device::direction_of(face.pose);
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        EXPECT_NEAR(face.mean_lsb[axis], direction[axis] * 234 + placer.truth().zero_lsb[axis],
                    0.3);
        EXPECT_NEAR(face.sd_lsb[axis], std::hypot(0.004 * 234, std::sqrt(1.0 / 12)), 0.15);
      }
      EXPECT_EQ(face.samples, 600);
      EXPECT_LT(face.tilt_deg, 0.5);
    }
    placer.verify();
    EXPECT_EQ(placer.run.verification().size(), 8U);
    EXPECT_EQ(placer.run.outcome(), JigOutcome::complete);
    EXPECT_EQ(placer.run.refusals(), 0);
    EXPECT_LT(dwell_budget_s({}), 180);
  }
}

TEST(JigRun, MovementDuringTheReadingIsRefused) {
  Placer placer;
  placer.shake(1.5);
  placer.rest({0, 0, 1}, 4);  // settles, and is in the dwell
  placer.shake(0.3);
  EXPECT_EQ(placer.last_refusal(), "moved during the reading");
  placer.place(Pose::plus_z);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::accepted);
  // A slow slide, too slow for the noise to show.
  placer.shake(1.5);
  const std::size_t before = placer.decided;
  for (int i = 0; placer.decided == before && i < 1000; ++i) {
    const double angle = i * 5e-5;
    placer.sample({std::cos(angle), std::sin(angle), 0});
  }
  EXPECT_EQ(placer.last_refusal(), "moved during the reading");
}

TEST(JigRun, AnAcceptedPoseIsNotReadTwiceWithoutBeingTouched) {
  Placer placer;
  placer.place(Pose::plus_z);
  const std::size_t decided = placer.decided;
  placer.rest({0, 0, 1}, 30);
  EXPECT_EQ(placer.decided, decided);
}

TEST(JigRun, LossBeginsTheReadingAnew) {
  Placer placer;
  placer.shake(1.5);
  placer.rest({0, 0, 1}, 5);
  placer.keep(placer.run.on_loss());
  placer.rest({0, 0, 1}, 5);
  EXPECT_EQ(placer.decided, 0U) << "no reading spans a loss";
  placer.rest({0, 0, 1}, 3);
  EXPECT_EQ(placer.run.faces().size(), 1U);
  EXPECT_EQ(placer.run.refusals(), 0);
}

TEST(JigRun, TheOperatorUndoesAndStops) {
  Placer placer;
  placer.place(Pose::plus_z);
  placer.place(Pose::plus_x);
  placer.keep(placer.run.on_operator(OperatorCommand::undo));
  EXPECT_EQ(placer.run.faces().size(), 1U);
  EXPECT_EQ(placer.run.open_poses().front(), Pose::plus_x);
  placer.place(Pose::plus_x);
  EXPECT_EQ(placer.run.faces().size(), 2U);
  placer.keep(placer.run.on_operator(OperatorCommand::stop));
  EXPECT_EQ(placer.run.outcome(), JigOutcome::stopped);
  EXPECT_TRUE(placer.run.on_operator(OperatorCommand::undo).empty());
}

TEST(JigRun, EveryStateHasAWayOut) {
  Placer idle;
  idle.rest({0.5, 0.5, 0.7}, 200);
  EXPECT_EQ(idle.run.outcome(), JigOutcome::timed_out);

  Placer gone;
  gone.keep(gone.run.on_unit_gone());
  EXPECT_EQ(gone.run.outcome(), JigOutcome::unit_gone);

  Placer hopeless;
  hopeless.place(Pose::plus_z);
  for (int i = 0; i < 20 && hopeless.run.phase() != JigPhase::finished; ++i) {
    hopeless.place(Pose::minus_z, 10, i * 50.0);
  }
  EXPECT_EQ(hopeless.run.outcome(), JigOutcome::too_many_refusals);
}

// The longest dwell of the command line.
TEST(JigRun, TheTimeOutLeavesTimeForALongDwell) {
  JigRunOptions options;
  options.dwell_s = 600;
  Placer placer(options);
  placer.shake(1.5);
  placer.rest({0, 0, 1}, 605);
  EXPECT_EQ(placer.run.faces().size(), 1U);
  EXPECT_EQ(placer.run.outcome(), JigOutcome::running);
  placer.rest({0, 0, 1}, 785);  // and then nothing comes
  EXPECT_EQ(placer.run.outcome(), JigOutcome::timed_out);
  EXPECT_EQ(placer.last.text, "nothing was accepted for 780 s");
}

TEST(JigRun, WriteAndRecheck) {
  JigRunOptions options;
  options.write = true;
  Placer placer(options);
  for (const Pose pose : kPoses) {
    placer.place(pose);
  }
  placer.verify();
  EXPECT_EQ(placer.run.phase(), JigPhase::writing);
  EXPECT_EQ(placer.count(JigAction::Kind::write), 1);
  placer.rest({0, 1, 0}, 3);  // nothing happens until it is written
  EXPECT_EQ(placer.run.phase(), JigPhase::writing);
  placer.keep(placer.run.on_written(placer.time_s));
  for (const Pose pose : options.recheck) {
    placer.place(pose);
  }
  EXPECT_EQ(placer.run.recheck().size(), 2U);
  EXPECT_EQ(placer.run.outcome(), JigOutcome::complete);
}

JigRunOptions production_plus() {
  JigRunOptions options;
  options.protocol = JigProtocol::production_plus;
  return options;
}

// All placements of a production run, and then three more.
Placer at_the_half_turns(const JigRunOptions& options = production_plus()) {
  Placer placer(options);
  for (const Pose pose : kPoses) {
    placer.place(pose);
  }
  placer.verify();
  return placer;
}

TEST(JigRun, ProductionPlusAsksForThreeFacesTurnedByHalfATurn) {
  Placer placer = at_the_half_turns();
  ASSERT_EQ(placer.run.phase(), JigPhase::turning);
  EXPECT_EQ(placer.log.back().text,
            "lay the unit, turned by half a turn about the vertical, on +x: its x axis points up, "
            "its y axis towards you");
  const auto faces = placer.run.faces();
  for (const Pose pose : {Pose::plus_x, Pose::plus_y, Pose::plus_z}) {
    EXPECT_EQ(placer.wanted, pose);
    placer.place(pose);
  }
  EXPECT_EQ(placer.run.outcome(), JigOutcome::complete);
  ASSERT_EQ(placer.run.half_turn().size(), 3U);
  for (const PoseReading& reading : placer.run.half_turn()) {
    EXPECT_EQ(reading.turned_deg, 180);
  }
  ASSERT_EQ(faces.size(), 6U);
  EXPECT_EQ(faces.front().turned_deg, 0);
  EXPECT_EQ(placer.run.verification().size(), 8U) << "they are no repeats";
  EXPECT_EQ(placements_of(production_plus()), 17U);
  EXPECT_EQ(placer.run.progress().placements(), 17U);
  EXPECT_LT(dwell_budget_s(production_plus()) - dwell_budget_s({}), 60);
}

// How each face lies, in the words of the table in jig_run.h, and that production does not ask.
TEST(JigRun, TheTableOfHowAFaceLies) {
  for (const JigProtocol protocol : {JigProtocol::production, JigProtocol::production_plus}) {
    JigRunOptions options;
    options.protocol = protocol;
    const bool plus = protocol == JigProtocol::production_plus;
    const Placer placer = at_the_half_turns(options);
    std::size_t asked = 0;
    for (const JigAction& action : placer.log) {
      if (action.kind == JigAction::Kind::place && action.text.starts_with("turn the unit to")) {
        const bool is_x = device::axis_of(action.pose) == 0;
        EXPECT_EQ(action.text.ends_with(is_x ? ", its y axis away from you"
                                             : ", its x axis to the right"),
                  plus)
            << action.text;
        ++asked;
      }
    }
    EXPECT_GE(asked, 12U);
    EXPECT_EQ(placer.run.phase(), plus ? JigPhase::turning : JigPhase::finished);
    EXPECT_EQ(placer.run.faces().front().turned_deg.has_value(), plus);
  }
}

TEST(JigRun, AUnitThatWasNotTippedIsNotTakenForTurned) {
  JigRunOptions options = production_plus();
  options.reseat = {Pose::minus_x, Pose::plus_z};  // it lies on +z, which is asked for next, too
  Placer placer = at_the_half_turns(options);
  ASSERT_EQ(placer.run.phase(), JigPhase::turning);
  placer.rest({0, 0, 1}, 20);
  EXPECT_TRUE(placer.run.half_turn().empty()) << "no motion";
  const int refusals = placer.run.refusals();
  placer.rest({0.1, 0, 0.99}, 0.3);  // a knock
  placer.rest({0, 0, 1}, 10);
  EXPECT_TRUE(placer.run.half_turn().empty());
  EXPECT_EQ(placer.run.refusals(), refusals + 1);
  EXPECT_THAT(placer.last_refusal(), testing::StartsWith("not turned: it lies on +z"));
  placer.keep(placer.run.on_unit_back(placer.time_s));  // after it was unplugged
  placer.rest({0, 0, 1}, 10);
  EXPECT_TRUE(placer.run.half_turn().empty());
  placer.place(Pose::minus_y);
  EXPECT_THAT(placer.last_refusal(), testing::StartsWith("wrong face: this is -y"));
  for (const Pose pose : {Pose::plus_z, Pose::plus_x, Pose::plus_y}) {  // in any order
    placer.place(pose);
  }
  EXPECT_EQ(placer.run.outcome(), JigOutcome::complete) << placer.last_refusal();
}

TEST(JigRun, HalfTurnsAreTakenBackAndGoneOnWith) {
  Placer placer = at_the_half_turns();
  placer.place(Pose::plus_x);
  placer.keep(placer.run.on_operator(OperatorCommand::undo));
  EXPECT_TRUE(placer.run.half_turn().empty());
  EXPECT_EQ(placer.wanted, Pose::plus_y) << "it lies on +x, and must be tipped before";
  placer.keep(placer.run.on_operator(OperatorCommand::undo));
  EXPECT_EQ(placer.run.phase(), JigPhase::reseating);
  placer.place(Pose::minus_x);
  placer.place(Pose::plus_y);
  ASSERT_EQ(placer.run.half_turn().size(), 1U) << placer.last_refusal();

  // Another program goes on: it lies as it lay, on a face that is done.
  Placer later(production_plus(), 2, Placer::approximation(), placer.truth());
  later.run.resume(placer.run.progress());
  later.keep(later.run.start(0));
  EXPECT_EQ(later.run.phase(), JigPhase::turning);
  later.rest({0, 1, 0}, 5);
  EXPECT_EQ(later.last_refusal(), "+y is done already");
  later.place(Pose::plus_z);
  later.place(Pose::plus_x);
  EXPECT_EQ(later.run.outcome(), JigOutcome::complete) << later.last_refusal();
  EXPECT_EQ(later.run.half_turn().size(), 3U);
}

// Where no half-turned reading is there yet, the unit lies as at the last of the eight.
TEST(JigRun, AResumedRunTakesNoUnitForTurnedThatWasNotTouched) {
  JigRunOptions options = production_plus();
  options.reseat = {Pose::minus_x, Pose::plus_z};
  const Placer before = at_the_half_turns(options);
  Placer later(options, 2, Placer::approximation(), before.truth());
  later.run.resume(before.run.progress());
  later.keep(later.run.start(0));
  later.rest({0, 0, 1}, 15);
  EXPECT_TRUE(later.run.half_turn().empty());
  EXPECT_THAT(later.last_refusal(), testing::StartsWith("not turned"));
}

}  // namespace
}  // namespace sixpoint::station
