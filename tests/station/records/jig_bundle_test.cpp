#include "station/records/jig_bundle.h"

#include <Eigen/LU>
#include <array>
#include <map>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "run_command.h"
#include "station/records/made_run.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

TEST(JigBundle, AStoredRunIsDiagnosed) {
  tests::TemporaryFolder folder;
  const std::string store = folder / "s.db";
  const auto jig =
      tests::run_command(posix_env(), {"jig", "--device", "virtual:seed=9,jig=auto", "--jig",
                                       "virtual", "--store", store, "--json"});
  ASSERT_EQ(jig.exit_code, 0) << jig.people;
  const std::string run = jig.json()["run"].get<std::string>();
  const auto diagnosed = tests::run_command(
      posix_env(), {"gap", "diagnose", "--run", run, "--store", store, "--json"});
  EXPECT_EQ(diagnosed.exit_code, 0) << diagnosed.people;
  const nlohmann::json json = nlohmann::json::parse(diagnosed.out);
  EXPECT_EQ(json["verdict"], "no_gap");
  bool mismatch = false;
  for (const nlohmann::json& hidden : json["not_observable"]) {
    mismatch = mismatch || hidden["name"] == "filter_mismatch";
  }
  EXPECT_TRUE(mismatch) << "raw counts do not show it";
  EXPECT_EQ(json["bundle"], "run " + run);
  EXPECT_THAT(
      tests::run_command(posix_env(), {"gap", "diagnose", "--run", run, "--store", store}).out,
      testing::StartsWith("run " + run.substr(0, 12) + ": "));
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", "--run", "00ff", "--store", store})
                .exit_code,
            66);
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose"}).exit_code, 64);
  const auto trends =
      tests::run_command(posix_env(), {"gap", "trends", "--store", store, "--json"});
  EXPECT_EQ(trends.exit_code, 2) << "one unit is too few";
  EXPECT_EQ(nlohmann::json::parse(trends.out)["jigs"][0]["belongs_to"], "too_few_units");
}

TEST(JigBundle, WhatDoesNotBelongTogetherIsRefused) {
  Random random(1, 1);
  const StoredRun run = made_run({.serial = "A"}, {}, {}, random);
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,2,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,nan,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, ""), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run({"i", "s", "jig", "", "", "[]"}, ""), ErrorCode::bad_data);
}

nlohmann::json diagnosed(const std::string& device, const std::string& protocol) {
  const tests::TemporaryFolder folder;
  const std::string store = folder / "s.db";
  const auto jig = tests::run_command(
      posix_env(), {"jig", "--device", device, "--store", store, "--protocol", protocol, "--json"});
  EXPECT_EQ(jig.exit_code, 0) << jig.people;
  const auto answer = tests::run_command(
      posix_env(), {"gap", "diagnose", "--run", jig.json()["run"].get<std::string>(), "--store",
                    store, "--json"});
  return nlohmann::json::parse(answer.out, nullptr, false);
}

// Oracle: the tilt and the misalignment of the virtual unit, which are small: production+ is sure of
// both, with both vectors right. (What production makes of such units: docs/gap.md, "At the jig".)
TEST(JigBundle, HalfTurnsTellTheJigsTiltFromTheUnits) {
  const std::map<std::string, std::array<double, 3>> truth_deg = {
      {"tilt", {0.0291, -0.0075, 0}}, {"misalignment", {-0.0023, -0.0204, -0.0219}}};
  const auto& tilt = truth_deg.at("tilt");
  const auto& turned = truth_deg.at("misalignment");
  const nlohmann::json plus = diagnosed(
      fmt::format("virtual:seed=104,jig=auto,jig_tilt_deg={}/{}/0,misalignment_deg={}/{}/{}",
                  tilt[0], tilt[1], turned[0], turned[1], turned[2]),
      "production+");
  ASSERT_EQ(plus["effects"].size(), 2U) << plus["brief"];
  for (const nlohmann::json& effect : plus["effects"]) {
    const auto truth = truth_deg.find(effect["name"].get<std::string>());
    ASSERT_NE(truth, truth_deg.end()) << effect["name"];
    EXPECT_GT(effect["probability"].get<double>(), 0.9);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(
          effect["parameters"]["rotation_vector_deg"][axis].get<double>(), truth->second[axis],
          3 * effect["standard_uncertainty"]["rotation_vector_deg"][axis].get<double>() + 1e-9);
    }
  }
}

// A report as production+ leaves it, and one of an earlier version, of the same samples.
TEST(JigBundle, HalfTurnedReadingsAreSegmentsOfTheirOwn) {
  Random random(1, 1);
  StoredRun run = made_run({.serial = "A"}, {}, {}, random);
  nlohmann::json report = nlohmann::json::parse(run.document);
  report.erase("verification");
  std::string csv = "time,x,y,z,c\n";
  nlohmann::json& poses = report["poses"];
  int time_us = 0;
  const auto rest = [&](int number, nlohmann::json& reading) {
    nlohmann::json mean = nlohmann::json::array();
    for (int axis = 0; axis < 3; ++axis) {
      mean.push_back(100 * number + 10 * axis + 0.5);
    }
    reading["mean_lsb"] = mean;
    reading["samples"] = 2;
    for (int half = 0; half < 2; ++half) {
      csv += fmt::format("{},{},{},{},25\n", time_us, 100 * number + half, 100 * number + 10 + half,
                         100 * number + 20 + half);
      time_us += 10000;
    }
  };
  for (std::size_t i = 0; i < poses.size(); ++i) {
    rest(static_cast<int>(i) + 1, poses[i]);
  }
  nlohmann::json turned = nlohmann::json::array();
  for (const char* pose : {"+x", "+y", "+z"}) {
    turned.push_back({{"pose", pose}, {"turned_deg", 180}});
    rest(static_cast<int>(turned.size()) + 6, turned.back());
  }
  run.document = report.dump();
  const auto earlier = bundle_of_run(run, csv);
  ASSERT_OK(earlier);
  EXPECT_EQ(earlier->segments.size(), 6U);
  report["half_turn"] = turned;
  run.document = report.dump();
  const auto bundle = bundle_of_run(run, csv);
  ASSERT_OK(bundle);
  ASSERT_EQ(bundle->segments.size(), 9U);
  for (std::size_t i = 6; i < 9; ++i) {
    const gap::Segment& segment = bundle->segments[i];
    EXPECT_EQ(segment.name, "half_turn");
    for (std::size_t k = 0; k < 6; ++k) {
      const gap::Segment& plain = bundle->segments[k];
      EXPECT_NE(plain.pose, segment.pose);
      if (plain.pose == segment.pose - 6) {
        EXPECT_LT((segment.rotation.col(2) - plain.rotation.col(2)).norm(), 1e-9);
        EXPECT_LT((segment.rotation.col(0) + plain.rotation.col(0)).norm(), 1e-9);
        EXPECT_NEAR(segment.rotation.determinant(), 1, 1e-9);
      }
    }
  }
  // The words of the prompt, from the table of station/run/jig_run.h: which axis of the unit lies
  // along "away from you" (y of the laboratory) or "to the right" (x).
  for (std::size_t k = 0; k < 6; ++k) {
    const gap::Segment& plain = bundle->segments[k];
    const bool is_x = device::axis_of(static_cast<device::Pose>(plain.pose)) == 0;
    EXPECT_NEAR(is_x ? plain.rotation(1, 1) : plain.rotation(0, 0), 1, 1e-9) << plain.pose;
  }
}

}  // namespace
}  // namespace sixpoint::station
