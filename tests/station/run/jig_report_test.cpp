#include "station/run/jig_report.h"

#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "expect_result.h"
#include "station/virtual_bench.h"

namespace sixpoint::station {
namespace {

// Oracle: closed form. At 250 LSB/g and zero 20, counts of (20, 20, 275) are 1.02 g: 20 mg more
// than gravity; (20, 20, -240) are 1.04 g.
TEST(JigReport, ReadingsAreJudgedByTheirLength) {
  calib::Calibration calibration;
  calibration.sensitivity_g_per_lsb.fill(1 / 250.0);
  calibration.zero_lsb = {20, 20, 20};
  PoseReading up;
  up.mean_lsb = {20, 20, 275};
  PoseReading down;
  down.mean_lsb = {20, 20, -240};
  const JudgedPoses judged = judge({up, down}, calibration, 1);
  ASSERT_EQ(judged.poses.size(), 2U);
  EXPECT_NEAR(judged.poses[0].magnitude_g, 1.02, 1e-12);
  EXPECT_NEAR(std::abs(judged.poses[0].error_mg), 20, 1e-9);
  EXPECT_NEAR(judged.worst_mg, 40, 1e-9);
  EXPECT_NEAR(judged.rms_mg, std::sqrt((20.0 * 20 + 40 * 40) / 2), 1e-9);
}

// The table of settle_as_left(), row by row.
TEST(JigReport, AsLeftFollowsTheTable) {
  device::CalibrationPage found;
  found.constants.zero_lsb = {1, 2, 3};
  device::CalibrationPage read;
  read.constants.zero_lsb = {4, 5, 6};
  const auto settled = [&](bool begun, const std::optional<device::CalibrationPage>& before) {
    JigReport report;
    report.as_found = found;
    report.as_left = before;
    report.write_begun = begun;
    report.settle_as_left();
    EXPECT_EQ(report.reasons.size(), begun ? 1U : 0U);
    return report.as_left;
  };
  EXPECT_EQ(settled(false, std::nullopt)->constants, found.constants);
  EXPECT_EQ(settled(false, read)->constants, read.constants);
  EXPECT_FALSE(settled(true, std::nullopt));
  EXPECT_FALSE(settled(true, read));
}

// Oracle: FIPS 180-4, SHA-256 of "abc".
TEST(JigReport, NamesItsSamplesByTheirHash) {
  JigReport report;
  report.raw_csv = "abc";
  EXPECT_EQ(report.raw_sha256(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(JigReportJson, HasTheContractsKeys) {
  VirtualBench bench;
  const auto report = bench.run();
  ASSERT_OK(report);
  const auto json = report->to_json();
  for (const char* key : {"serial", "filter", "verdict", "poses", "constants", "as_found",
                          "as_left", "verification", "uncertainty"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["poses"].size(), 6U);
  for (const char* key : {"pose", "mean_lsb", "sd_lsb", "samples", "temperature_c", "tilt_deg"}) {
    EXPECT_TRUE(json["poses"][0].contains(key)) << key;
  }
  std::vector<std::string> counts;
  for (const auto& [key, value] : json["stream"].items()) {
    counts.push_back(key);
  }
  EXPECT_EQ(counts, (std::vector<std::string>{"samples", "lost_samples", "duplicate_reports",
                                              "damaged_reports", "overflowed_blocks",
                                              "failed_transfers", "clock_jumps", "clock_jumped_s"}))
      << "all that are counted";
  EXPECT_TRUE(json["verification"].contains("residual_mg"));
  EXPECT_EQ(json["verification"]["poses"].size(), 8U);
}

}  // namespace
}  // namespace sixpoint::station
