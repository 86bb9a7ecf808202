#include "station/run/budget.h"

#include <cmath>

#include <gtest/gtest.h>

#include "station/run/jig_report.h"

namespace sixpoint::station {
namespace {

struct Standing {
  double k2_g = 0;        // second order of X, g per g squared
  double turned_rad = 0;  // of the sensor in its case about Y
  double lean_y_rad = 0;  // of the sides +y and -y towards +Z
  double lean_x_rad = 0;  // of the sides +x and -x
};

// A sensor of 250 LSB per g without noise in its six poses, not rounded to whole counts.
JigReport six_poses_of(const Standing& standing) {
  constexpr double kLsbPerG = 250;
  JigReport report;
  std::vector<calib::PoseMean> used;
  for (const device::Pose pose : device::kPoses) {
    const auto up = device::direction_of(pose);
    const double lean = up[0] != 0 ? standing.lean_x_rad : up[1] != 0 ? standing.lean_y_rad : 0;
    const PerAxis<double> stands = {up[0] * std::cos(lean), up[1] * std::cos(lean),
                                    up[2] + std::sin(lean)};
    const PerAxis<double> force_g = {
        stands[0] * std::cos(standing.turned_rad) + stands[2] * std::sin(standing.turned_rad),
        stands[1],
        stands[2] * std::cos(standing.turned_rad) - stands[0] * std::sin(standing.turned_rad)};
    calib::PoseMean reading;
    reading.up = up;
    reading.samples = 600;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double curved = axis == 0 ? standing.k2_g * force_g[0] * force_g[0] : 0;
      reading.mean_lsb[axis] = 20 + kLsbPerG * (force_g[axis] + curved);
    }
    used.push_back(reading);
    PoseReading face;
    face.pose = pose;
    face.mean_lsb = reading.mean_lsb;
    face.samples = reading.samples;
    report.faces.push_back(face);
  }
  calib::SixPoseOptions options;
  options.gravity = calib::LocalGravity{kStandardGravity_m_per_s2, 1e-6};
  report.six = *calib::solve_six_poses(used, {}, options);
  return report;
}

std::vector<Measured> measured_as(const JigReport& report, std::string_view name) {
  std::vector<Measured> found;
  for (const Measured& measured : measured_quantities(report)) {
    if (measured.name == name) {
      found.push_back(measured);
    }
  }
  return found;
}

std::vector<Measured> midpoints(const Standing& standing) {
  return measured_as(six_poses_of(standing), "midpoint_minus_zero_mg");
}

// Oracle: the same readings with local gravity at each end of its stated range (k = 2) are another
// number of mg, and the U that is stated without it covers that.
TEST(Budget, TheUncertaintyOfAZeroCoversLocalGravity) {
  JigReport report = six_poses_of({});
  const double zero_lsb = 0.699 * 250;
  report.six->per_axis.calibration.zero_lsb.fill(zero_lsb);
  report.six->chosen = calib::SixPoseMethod::per_axis;
  const double sd_relative = 0.0015;
  report.combined.sensitivity_relative.fill(sd_relative);
  report.combined.zero_mg.fill(0.3);
  report.six->midpoint_minus_zero_lsb.fill(10);
  const auto of = [&](std::string_view name) {
    return judge_quantity(measured_as(report, name).at(0), default_limits());
  };
  for (const char* name : {"zero_offset_mg", "midpoint_minus_zero_mg"}) {
    const JudgedQuantity stated = of(name);
    for (const double end : {1 - 2 * sd_relative, 1 + 2 * sd_relative}) {
      EXPECT_LE(std::abs(stated.value * end - stated.value), stated.expanded_uncertainty) << name;
    }
  }
  EXPECT_NEAR(of("zero_offset_mg").expanded_uncertainty, 2 * std::hypot(0.3, 699 * sd_relative),
              1e-6);
  EXPECT_EQ(of("zero_offset_mg").verdict, JigVerdict::conditional_pass) << "0.3 mg would be a pass";
  // What the constants leave is in zero and scale alike: 0.4 * (1 + 0.699).
  report.verification.rms_mg = 0.4;
  report.combined.zero_mg.fill(0.4);
  report.combined.sensitivity_relative.fill(0.0004);
  EXPECT_NEAR(of("zero_offset_mg").expanded_uncertainty, 2 * 0.4 * 1.699, 1e-6);
}

// 0 / 0 is no rate of 0 %; 30 of 1000 are 3 %.
TEST(Budget, ARunWithoutSamplesHasNoRateOfLosses) {
  JigReport report = six_poses_of({});
  EXPECT_TRUE(std::isnan(measured_as(report, "lost_samples_percent").at(0).value));
  report.stream.samples = 970;
  report.stream.lost_samples = 30;
  EXPECT_DOUBLE_EQ(measured_as(report, "lost_samples_percent").at(0).value, 3);
}

// Oracle: closed form. At +1 g and -1 g a second order adds K2 to both readings and nothing to the
// level ones.
TEST(MidpointMinusZero, IsTheSecondOrder) {
  for (const double k2_mg : {60.0, -60.0, 29.0, 0.0}) {
    Standing standing;
    standing.k2_g = k2_mg / kMgPerG;
    const auto found = midpoints(standing);
    ASSERT_EQ(found.size(), kAxes);
    EXPECT_NEAR(found[0].value, k2_mg, 1e-6);
    EXPECT_NEAR(found[1].value, 0, 1e-6);
    EXPECT_NEAR(found[2].value, 0, 1e-6);
    const JudgedQuantity judged = judge_quantity(found[0], default_limits());
    const bool bad = std::abs(k2_mg) > 45;
    EXPECT_EQ(judged.verdict, bad ? JigVerdict::fail : JigVerdict::pass) << k2_mg;
    EXPECT_EQ(judged.code, bad ? "midpoint_off" : "");
    // 0.2 mg of floor in the means, 0.02 degrees of seating in each of four level readings.
    const double seating_mg = kMgPerG * 0.02 * M_PI / 180;
    EXPECT_NEAR(judged.expanded_uncertainty,
                2 * std::hypot(0.2 / std::sqrt(2.0), std::hypot(seating_mg, 0.2) / 2), 1e-6);
  }
}

// Oracle: closed form. A sensor askew in its case reads opposite signs in opposite poses; sides
// that lean towards the same end read the same sign.
TEST(MidpointMinusZero, AskewCancelsAndALeaningCaseDoesNot) {
  for (const double degrees : {1.0, 4.0, 10.0}) {
    const double radian = degrees * M_PI / 180;
    Standing askew;
    askew.turned_rad = radian;
    for (const Measured& measured : midpoints(askew)) {
      EXPECT_NEAR(measured.value, 0, 1e-6) << degrees << " degrees, " << measured.axis;
    }
    Standing tapered;
    tapered.lean_x_rad = radian;
    tapered.lean_y_rad = radian;
    const auto found = midpoints(tapered);
    EXPECT_NEAR(found[2].value, -kMgPerG * std::sin(radian), 1e-6);
    EXPECT_NEAR(found[0].value, 0, 1e-6);
    EXPECT_NEAR(found[1].value, 0, 1e-6);
  }
  // One pair of sides only: half of it, and the two pairs' disagreement is in the uncertainty, by
  // Student's factor for 3 degrees of freedom.
  Standing one;
  one.lean_y_rad = 0.02;
  const auto found = midpoints(one);
  const double lean_mg = kMgPerG * std::sin(0.02);
  EXPECT_NEAR(found[2].value, -lean_mg / 2, 1e-6);
  EXPECT_NEAR(found[2].standard_uncertainty, 3.31 / 2 * lean_mg / std::sqrt(3.0) / 2, 0.01);
}

// Oracle: closed form. Two of 200 samples are 1 %.
TEST(Budget, CountsLostSamplesAndTheTemperatureRange) {
  JigReport report;
  report.six.emplace();
  for (const device::Pose pose : device::kPoses) {
    PoseReading face;
    face.pose = pose;
    face.temperature_c = pose == device::Pose::plus_x ? 22 : 20;
    face.tilt_deg = pose == device::Pose::minus_y ? 1.5 : 0.5;
    report.faces.push_back(face);
  }
  JudgedPose warm;
  warm.reading.temperature_c = 25;
  report.verification.poses.push_back(warm);
  report.stream.samples = 198;
  report.stream.lost_samples = 2;
  const auto value_of = [&](std::string_view name) {
    for (const Measured& measured : measured_quantities(report)) {
      if (measured.name == name) {
        return measured.value;
      }
    }
    return -1.0;
  };
  EXPECT_DOUBLE_EQ(value_of("lost_samples_percent"), 1);
  EXPECT_DOUBLE_EQ(value_of("temperature_change_c"), 5);
  EXPECT_NEAR(value_of("temperature_c"), 20 + 2.0 / 6, 1e-12) << "of the faces alone";
  EXPECT_DOUBLE_EQ(value_of("tilt_deg"), 1.5);
  EXPECT_EQ(value_of("recheck_residual_mg"), -1) << "nothing was written";
}

TEST(Budget, WithoutASolutionThereIsNothingToJudge) {
  EXPECT_TRUE(measured_quantities(JigReport{}).empty());
}

}  // namespace
}  // namespace sixpoint::station
