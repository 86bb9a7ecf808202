// How the state machine judges a placement.
#include <gmock/gmock.h>

#include "station/run/placer.h"

namespace sixpoint::station {
namespace {

using device::kPoses;
using testing::HasSubstr;

TEST(JigPlacement, ATiltedUnitIsRefusedWithTheAngleAndAskedAgain) {
  Placer placer;
  placer.place(Pose::plus_z);
  placer.place(Pose::minus_z, 7.2);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::refused);
  // The angle is computed with the approximation, which is 10 % off: 7.2 * 0.9 to 7.2 * 1.1.
  double angle = 0;
  ASSERT_EQ(std::sscanf(placer.last_refusal().c_str(), "tilted %lf degrees", &angle), 1);
  EXPECT_NEAR(angle, 7.2, 0.9);
  EXPECT_EQ(placer.log.back().kind, JigAction::Kind::place);
  EXPECT_EQ(placer.log.back().pose, Pose::minus_z) << "asked again";
  placer.place(Pose::minus_z);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::accepted);
  EXPECT_EQ(placer.run.faces().size(), 2U);
}

// After the six faces are known the angle is that of the truth.
TEST(JigPlacement, TheAngleIsRightOnceTheUnitIsKnown) {
  Placer placer;
  for (const Pose pose : kPoses) {
    placer.place(pose);
  }
  placer.run.set_approximation(placer.truth());
  placer.place(Pose::plus_z, 7.2);
  EXPECT_EQ(placer.last_refusal(), "tilted 7.2 degrees");
}

TEST(JigPlacement, TheFirstPoseMayBeTheTiltedOne) {
  Placer placer;
  placer.place(Pose::plus_z, 7.2);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::accepted) << "nothing yet to compare it with";
  placer.place(Pose::minus_z);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::refused) << "one of the two is tilted";
  placer.place(Pose::minus_z);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::accepted) << "it repeats itself";
  EXPECT_EQ(placer.count(JigAction::Kind::dropped), 1);
  ASSERT_EQ(placer.run.faces().size(), 1U);
  EXPECT_EQ(placer.run.faces().front().pose, Pose::minus_z);
  for (const Pose pose : kPoses) {
    if (pose != Pose::minus_z) {
      placer.place(pose);
      EXPECT_EQ(
          placer.last.kind == JigAction::Kind::accepted || placer.last.kind == JigAction::Kind::fit,
          true);
    }
  }
  EXPECT_EQ(placer.run.phase(), JigPhase::verifying);
}

TEST(JigPlacement, ATiltThatRepeatsItselfIsRefusedWhereTwoDisagree) {
  Placer placer;
  placer.place(Pose::plus_z);
  placer.place(Pose::minus_z);
  placer.place(Pose::plus_x);
  placer.place(Pose::plus_y, 8, 90);  // about the axis that +z and -z have seen level
  placer.place(Pose::plus_y, 8, 90);
  EXPECT_EQ(placer.last.kind, JigAction::Kind::refused);
  EXPECT_EQ(placer.count(JigAction::Kind::dropped), 0);
  EXPECT_EQ(placer.run.faces().size(), 3U);
}

// The first placement is tilted, and the next ones lie on faces that do not show it: the mean of
// the level readings hides the tilt. The second round shows it. Oracle: the made truth of every
// pose.
TEST(JigPlacement, ATiltThatTheFirstRoundHidesIsFoundInTheSecondAndMeasuredAgain) {
  Placer placer;
  placer.place(Pose::plus_z, 5.4, 45);
  for (const Pose pose :
       {Pose::plus_x, Pose::minus_x, Pose::plus_y, Pose::minus_y, Pose::minus_z}) {
    placer.place(pose);
  }
  ASSERT_EQ(placer.run.phase(), JigPhase::verifying)
      << "nothing was seen: " << placer.last_refusal();
  ASSERT_EQ(placer.run.refusals(), 0);
  placer.verify();
  EXPECT_EQ(placer.run.outcome(), JigOutcome::complete);
  EXPECT_EQ(placer.run.refusals(), 1) << "the newer is asked for again";
  EXPECT_THAT(placer.last_refusal(), HasSubstr("from how it lay in the first round"));
  EXPECT_EQ(placer.count(JigAction::Kind::dropped), 1);
  EXPECT_EQ(placer.count(JigAction::Kind::fit), 2) << "computed anew from the faces that hold";
  ASSERT_EQ(placer.run.faces().size(), 6U);
  EXPECT_EQ(placer.run.verification().size(), 8U);
  for (const PoseReading& face : placer.run.faces()) {
    const PerAxis<double> force_g = placer.truth().to_g(face.mean_lsb);
    EXPECT_LT(nearest_face(force_g).angle_deg, 0.2) << device::to_string(face.pose);
    for (const PoseReading& again : placer.run.verification()) {
      EXPECT_FALSE(again.pose == face.pose && again.start_s == face.start_s)
          << "a reading that is fitted judges nothing";
    }
  }
}

// A single slip in the second round changes nothing in the first.
TEST(JigPlacement, ASlipInTheSecondRoundIsAskedAgainAndTheFirstRoundStays) {
  Placer placer;
  for (const Pose pose : kPoses) {
    placer.place(pose);
  }
  const auto before = placer.run.faces();
  placer.place(placer.wanted, 5.4);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("tilted"));
  placer.verify();
  EXPECT_EQ(placer.run.outcome(), JigOutcome::complete);
  EXPECT_EQ(placer.count(JigAction::Kind::dropped), 0);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(placer.run.faces()[i].start_s, before[i].start_s);
  }
}

// Two placements tilted alike outvote every good one; the midpoint of the upright readings, which a
// tilt does not move, shows that they are wrong.
TEST(JigPlacement, TwoThatAreTiltedAlikeAreFoundByTheMidpoints) {
  Placer placer;
  placer.place(Pose::plus_z, 8, 0);
  placer.place(Pose::minus_z, 8, 0);
  placer.place(Pose::plus_x);
  placer.place(Pose::minus_x);
  ASSERT_EQ(placer.run.faces().size(), 4U) << placer.last_refusal();
  placer.place(Pose::plus_y);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("tilted"));
  placer.place(Pose::plus_y);
  EXPECT_EQ(placer.count(JigAction::Kind::dropped), 2);
  ASSERT_EQ(placer.run.faces().size(), 3U);
  for (const Pose pose : {Pose::minus_y, Pose::plus_z, Pose::minus_z}) {
    placer.place(pose);
  }
  EXPECT_EQ(placer.run.phase(), JigPhase::verifying) << placer.last_refusal();
  for (const PoseReading& face : placer.run.faces()) {
    EXPECT_LT(nearest_face(placer.truth().to_g(face.mean_lsb)).angle_deg, 0.2);
  }
}

TEST(JigPlacement, WrongFacesAreNamed) {
  Placer placer;
  placer.place(Pose::plus_z);
  placer.place(Pose::plus_z);
  EXPECT_EQ(placer.last_refusal(), "+z is done already");
  placer.shake(1.5);
  placer.rest({0.7, 0, 0.7}, 3);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("lies on none of its six faces"));
  placer.stuck = true;
  placer.place(Pose::plus_x);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("z axis does not change at all"));
}

// A sensor may be anywhere within its datasheet's limits, and its constants lost: nothing but the
// order of its readings tells the faces then.
TEST(JigPlacement, AUnitWithoutUsefulConstantsIsMeasured) {
  const calib::Calibration nominal = first_approximation(std::nullopt).calibration;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    calib::Calibration truth;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double lsb_per_g = random.uniform(210, 285);
      truth.sensitivity_g_per_lsb[axis] = 1 / lsb_per_g;
      truth.zero_lsb[axis] = random.uniform(-0.4, 0.4) * lsb_per_g;
    }
    Placer placer({}, seed, nominal, truth);
    for (int i = 0; i < 12 && placer.run.phase() == JigPhase::measuring; ++i) {
      placer.place(placer.wanted);
    }
    ASSERT_EQ(placer.run.phase(), JigPhase::verifying) << seed << ": " << placer.last_refusal();
    for (const PoseReading& face : placer.run.faces()) {
      const auto direction = device::direction_of(face.pose);
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        EXPECT_NEAR(face.mean_lsb[axis],
                    direction[axis] / truth.sensitivity_g_per_lsb[axis] + truth.zero_lsb[axis], 0.4)
            << seed;
      }
    }
  }
}

// An affected unit holds constants of the other filter configuration, which show it 25 degrees off.
// From the first face on the picture uses the readings of the run. Oracle: the made truth; until
// there are six faces the sensitivity may be 11 % off, and the zeros are right.
TEST(JigPlacement, ThePictureUsesTheFacesOfTheRun) {
  calib::Calibration truth;
  truth.sensitivity_g_per_lsb.fill(1 / 234.0);
  truth.zero_lsb = {40, 40, 40};
  calib::Calibration wrong;
  wrong.sensitivity_g_per_lsb.fill(1 / 260.0);
  wrong.zero_lsb = {40 - 0.33 * 260, 40 + 0.33 * 260, 40};
  Placer placer({}, 3, wrong, truth);
  const auto shown_deg = [&](Pose pose) {
    PerAxis<double> mean_lsb = truth.zero_lsb;
    mean_lsb[device::axis_of(pose)] += device::sign_of(pose) * 234.0;
    const NearestFace face = nearest_face(placer.run.approximation().to_g(mean_lsb));
    EXPECT_EQ(face.pose, pose);
    return face.angle_deg;
  };
  EXPECT_GT(shown_deg(Pose::plus_z), 24) << "as long as nothing else is known";
  placer.place(Pose::plus_z);
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  EXPECT_LT(shown_deg(Pose::plus_z), 0.5);
  placer.place(Pose::minus_x);
  ASSERT_EQ(placer.run.faces().size(), 2U) << placer.last_refusal();
  for (const Pose pose : kPoses) {
    EXPECT_LT(shown_deg(pose), 0.5) << "by levels alone: every axis lay level once";
  }
}

TEST(JigPlacement, LeaningIsTakenAtFirstOnlyWhereItRepeatsItself) {
  Placer placer;
  placer.place(Pose::plus_z, 40);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("none of its six faces"));
  placer.place(Pose::plus_z, 36);  // a hand leans it otherwise the second time
  EXPECT_THAT(placer.last_refusal(), HasSubstr("none of its six faces"));
  EXPECT_TRUE(placer.run.faces().empty());
  // And where it does repeat itself, the others show what it was.
  placer.place(Pose::plus_z, 36);
  ASSERT_EQ(placer.run.faces().size(), 1U);
  for (int i = 0; i < 20 && placer.run.phase() == JigPhase::measuring; ++i) {
    placer.place(placer.wanted);
  }
  ASSERT_EQ(placer.run.phase(), JigPhase::verifying);
  for (const PoseReading& face : placer.run.faces()) {
    const auto direction = device::direction_of(face.pose);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      EXPECT_NEAR(face.mean_lsb[axis], direction[axis] * 234 + placer.truth().zero_lsb[axis], 0.4);
    }
  }
}

calib::Calibration nominal() { return first_approximation(std::nullopt).calibration; }

calib::Calibration sensor_of(const PerAxis<double>& lsb_per_g, const PerAxis<double>& zero_lsb) {
  calib::Calibration sensor;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    sensor.sensitivity_g_per_lsb[axis] = 1 / lsb_per_g[axis];
  }
  sensor.zero_lsb = zero_lsb;
  return sensor;
}

// The table of jig_run.h, a row each. Oracle: the face that the unit was laid on.
TEST(JigPlacementTable, RowTheJigSaysWhereItStands) {
  Placer placer({}, 1, nominal(), sensor_of({250, 250, 250}, {0, 0, -300}));  // reads -z
  placer.run.set_jig_pose(Pose::plus_z);
  placer.place(Pose::plus_z);
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  EXPECT_EQ(placer.run.faces()[0].pose, Pose::plus_z);

  // The unit is turned by a quarter in the jig: the first placement cannot show it, the next does.
  Placer askew({}, 1, nominal(), nominal());
  askew.run.set_jig_pose(Pose::plus_z);
  askew.place(Pose::plus_x);
  askew.run.set_jig_pose(Pose::minus_z);
  askew.place(Pose::minus_x);
  EXPECT_EQ(askew.last.pose, Pose::minus_x) << "the jig is at -z, and is not believed";
}

TEST(JigPlacementTable, RowNearAFaceByTheConstants) {
  Placer placer({}, 1, nominal(), nominal());
  placer.place(Pose::plus_x);  // +z was asked for
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  EXPECT_EQ(placer.run.faces()[0].pose, Pose::plus_x);
  // By its own constants it lies on +x.
  Placer differ({}, 1, sensor_of({256, 256, 256}, {40 - 300, 40, 40 + 256}), nominal());
  differ.place(Pose::plus_z);
  ASSERT_EQ(differ.run.faces().size(), 1U) << differ.last_refusal();
  EXPECT_EQ(differ.run.faces()[0].pose, Pose::plus_z);
}

TEST(JigPlacementTable, RowAZeroExplainsTheAskedFace) {
  Placer placer({}, 1, nominal(), sensor_of({256, 256, 256}, {-200, 0, 0}));
  placer.place(Pose::plus_z);
  EXPECT_THAT(placer.last_refusal(), HasSubstr("none of its six faces"));
  EXPECT_TRUE(placer.run.faces().empty());
  placer.place(Pose::plus_z);
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  EXPECT_EQ(placer.run.faces()[0].pose, Pose::plus_z);
}

TEST(JigPlacementTable, RowNoSuchZero) {
  Placer placer({}, 1, nominal(), nominal());
  for (int i = 0; i < 2; ++i) {
    placer.shake(1.5);
    placer.rest({0.72, 0.69, 0}, 9);  // +z was asked for
  }
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  EXPECT_EQ(placer.run.faces()[0].pose, Pose::plus_x);
}

TEST(JigPlacementTable, RowTheChangesFitTheExpectedFace) {
  for (const double lsb_per_g : {100.0, 250.0, 400.0}) {
    for (const double zero_lsb : {-250.0, 0.0, 250.0}) {
      Placer placer({}, 1, nominal(),
                    sensor_of({250, 250, lsb_per_g}, {zero_lsb, -zero_lsb, zero_lsb}));
      for (int i = 0; i < 6 && placer.run.phase() == JigPhase::measuring; ++i) {
        placer.run.set_jig_pose(placer.wanted);
        placer.place(placer.wanted);
      }
      EXPECT_EQ(placer.run.phase(), JigPhase::verifying)
          << lsb_per_g << ' ' << zero_lsb << ": " << placer.last_refusal();
      EXPECT_EQ(placer.run.refusals(), 0);
    }
  }
}

// Without a jig that says where it stands, the expected face is the one that is asked for. By the
// constants, which say 256 LSB/g, the zero of z lies at 100 - 256: a unit on -z would lie on +z.
TEST(JigPlacementTable, RowTheChangesFitTheAskedFace) {
  Placer placer({}, 1, nominal(), sensor_of({250, 250, 100}, {0, 0, 0}));
  placer.run.set_jig_pose(Pose::plus_z);
  placer.place(Pose::plus_z);
  ASSERT_EQ(placer.run.faces().size(), 1U) << placer.last_refusal();
  placer.run.set_jig_pose({});
  ASSERT_EQ(placer.wanted, Pose::minus_z);
  placer.place(Pose::minus_z);
  ASSERT_EQ(placer.run.faces().size(), 2U) << placer.last_refusal();
  EXPECT_EQ(placer.run.faces()[1].pose, Pose::minus_z);
  for (int i = 0; i < 4; ++i) {
    placer.place(placer.wanted);
  }
  EXPECT_EQ(placer.run.phase(), JigPhase::verifying) << placer.last_refusal();
  EXPECT_EQ(placer.run.refusals(), 0);
}

TEST(JigPlacementTable, RowTheChangesDoNotFitIt) {
  Random random(1);
  for (int i = 0; i < 40; ++i) {
    PerAxis<double> lsb_per_g{};
    PerAxis<double> zero_lsb{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      lsb_per_g[axis] = random.uniform(150, 350);
      zero_lsb[axis] = random.uniform(-1, 1) * lsb_per_g[axis];
    }
    for (const Pose laid : {Pose::plus_z, Pose::plus_x, Pose::minus_y}) {
      Placer placer({}, 1, nominal(), sensor_of(lsb_per_g, zero_lsb));
      placer.run.set_jig_pose(Pose::plus_z);
      placer.place(Pose::plus_z);
      ASSERT_EQ(placer.run.faces().size(), 1U);
      placer.run.set_jig_pose(Pose::minus_z);
      placer.place(laid);
      EXPECT_EQ(placer.last.pose, laid) << i << ": the jig says -z";
    }
  }
}

TEST(JigPlacement, ConstantsThatNoSensorHasAreNotUsed) {
  const StoredConstants good = {{311, 310, 287}, {-204, -216, -234}, {54, 47, 26}};
  EXPECT_FALSE(first_approximation(good).is_nominal);
  StoredConstants turned = good;
  turned.positive_lsb[1] = -300;
  EXPECT_TRUE(first_approximation(turned).is_nominal);
  StoredConstants narrow = good;
  narrow.positive_lsb[0] = -190;  // 7 LSB per g
  EXPECT_TRUE(first_approximation(narrow).is_nominal);
  StoredConstants far = good;
  far.zero_lsb[2] = 700;
  EXPECT_TRUE(first_approximation(far).is_nominal);
  EXPECT_TRUE(first_approximation(std::nullopt).is_nominal);
}

TEST(JigPlacement, StillnessGoesByTheUnitsOwnNoise) {
  Placer noisy;
  noisy.noise_mg = 15;
  noisy.place(Pose::plus_z);
  EXPECT_EQ(noisy.last.kind, JigAction::Kind::accepted) << "a noisy sensor at rest is at rest";

  Placer held;
  held.noise_mg = 40;  // held in the hand
  held.place(Pose::plus_z);
  EXPECT_EQ(held.decided, 0U);

  Placer trembling;
  trembling.place(Pose::plus_z);
  trembling.noise_mg = 15;  // this unit's own noise is 4
  trembling.place(Pose::plus_x);
  EXPECT_EQ(trembling.run.faces().size(), 1U);
}

}  // namespace
}  // namespace sixpoint::station
