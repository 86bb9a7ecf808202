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

}  // namespace
}  // namespace sixpoint::station
