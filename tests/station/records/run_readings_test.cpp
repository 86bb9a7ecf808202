#include "station/records/run_readings.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "station/records/made_run.h"

namespace sixpoint::station {
namespace {

constexpr MadeScatter kExact{0, 0, 0};

// The oracle is made_run(): rotations of the force, not the formulas of the reader.
TEST(RunReadings, AreThoseOfTheUnitAndTheJig) {
  Random random(1, 1);
  MadeUnit unit;
  unit.serial = "A";
  MadeJig jig;
  jig.base_deg = {0.3, 0};
  jig.face_deg[device::Pose::plus_y] = {0, 0.5};
  const auto readings = readings_of_run(made_run(unit, jig, kExact, random));
  ASSERT_OK(readings);
  EXPECT_EQ(readings->placements, 2U);
  EXPECT_EQ(readings->filter, "current");
  EXPECT_NEAR(*readings->temperature_c, 24.5, 1e-9);
  // kPoses: +z -z +x -x +y -y; the base leans +z towards x, +x towards y, +y towards z.
  const SkewPattern expected = {0.3, 0, 0.3, 0, 0.3, 0, 0.3, 0, 0.5, 0.3, 0, 0.3};
  for (std::size_t k = 0; k < expected.size(); ++k) {
    EXPECT_NEAR(readings->skew_deg[k], expected[k], 0.005) << k;
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    EXPECT_NEAR(readings->zero_mg[axis], unit.zero_mg[a], 0.05);
    EXPECT_NEAR(readings->sensitivity_lsb_per_g[axis] / unit.sensitivity_lsb_per_g[a], 1, 1e-4);
  }
  for (const FaceRepeats& face : readings->repeats) {
    EXPECT_NEAR(face.square_deg2, 0, 1e-12);
    EXPECT_EQ(face.degrees_of_freedom, 2);
  }
}

TEST(RunReadings, RepeatsScatterAsThePlacements) {
  Random random(2, 1);
  double square = 0;
  double freedom = 0;
  for (int i = 0; i < 100; ++i) {
    const auto readings = readings_of_run(made_run({.serial = "A"}, {}, {0.02, 0, 0}, random));
    ASSERT_OK(readings);
    for (const FaceRepeats& face : readings->repeats) {
      square += face.square_deg2;
      freedom += face.degrees_of_freedom;
    }
  }
  EXPECT_NEAR(std::sqrt(square / freedom), 0.02, 0.002) << "2400 differences: 3 % at most";
}

TEST(RunReadings, WhatNoUnitReadsIsRefused) {
  Random random(3, 1);
  const StoredRun good = made_run({.serial = "A"}, {}, kExact, random);
  const auto with = [&](const auto& change) {
    StoredRun run = good;
    auto report = nlohmann::json::parse(run.document);
    change(report);
    run.document = report.dump();
    return readings_of_run(run);
  };
  EXPECT_OK(with([](auto& /*report*/) {}));
  EXPECT_OK(with([](auto& report) { report.erase("verification"); }));
  EXPECT_FAILS(with([](auto& report) {
                 report["poses"].erase(3);
                 report.erase("verification");
               }),
               ErrorCode::bad_data);
  EXPECT_FAILS(with([](auto& report) { report["poses"][0]["mean_lsb"][1] = nullptr; }),
               ErrorCode::bad_data);
  EXPECT_FAILS(with([](auto& report) { report["poses"][0]["mean_lsb"][1] = 1e308; }),
               ErrorCode::bad_data);
  // A face that leans by thirty degrees.
  EXPECT_FAILS(with([](auto& report) { report["poses"][0]["mean_lsb"][1] = 250; }),
               ErrorCode::bad_data);
  EXPECT_FAILS(with([](auto& report) { std::swap(report["poses"][0], report["verification"]); }),
               ErrorCode::bad_data);
  for (const char* text : {"{}", "nonsense", "[]", R"({"poses": 7})"}) {
    EXPECT_FAILS(readings_of_run({"x", "s", "jig", "", "", text}), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::station
