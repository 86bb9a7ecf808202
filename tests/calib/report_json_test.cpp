// The JSON of the two reports, without a solver: numbers that were put in by hand stand under their
// keys.
#include <algorithm>
#include <limits>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "calib/made_blocks.h"
#include "calib/poses/six_pose.h"
#include "calib/solve.h"
#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::blocks_of;
using tests::file_constants;
using tests::mismatched;
using tests::SyntheticUnit;
using Json = nlohmann::ordered_json;

TEST(ReportJson, JsonHasTheContractsKeys) {
  const SyntheticUnit unit = mismatched(3);
  const auto blocks = blocks_of(unit, tests::kSixSides, {30, 60, 4}, 5);
  auto report = solve_from_still_blocks(blocks, file_constants(unit));
  ASSERT_OK(report);
  report->serial = "MOS2A45130450";
  report->filter = FilterConfiguration::current;
  const auto json = to_json(*report);
  for (const char* key : {"serial", "filter", "method", "constants", "standard_uncertainty",
                          "points", "coverage_g", "residual_mg", "verified", "verdict", "reasons",
                          "missing_directions", "iterations", "seconds"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  // As the file's own, wrong constants have it.
  const auto& subsets = json["coverage_g"]["value_subsets"];
  for (std::size_t a = 0; a < 3; ++a) {
    const auto between = [&](double low_g, double high_g) {
      return std::count_if(blocks.begin(), blocks.end(), [&](const StillBlock& block) {
        return !block.noisy && block.mean_g[a] > low_g && block.mean_g[a] < high_g;
      });
    };
    EXPECT_EQ(subsets["low"][a], between(-1.3, -0.7));
    EXPECT_EQ(subsets["middle"][a], between(-0.7, 0.7));
    EXPECT_EQ(subsets["high"][a], between(0.7, 1.3));
  }
  const auto record = record_of(*report, *parse_iso8601("2016-05-16"), {"00", "a.gt3x", ""});
  ASSERT_OK(record);
  const auto back = parse_constants_record(to_json(*record).dump());
  ASSERT_OK(back);
  EXPECT_EQ(back->calibration, *report->calibration);
}

// Without points there is nothing to say: null, and no number that no one measured.
TEST(ReportJson, AReportWithoutPointsHasNulls) {
  const Json json = to_json(SolveReport{});
  for (const char* key : {"filter", "constants", "standard_uncertainty"}) {
    EXPECT_TRUE(json.at(key).is_null()) << key;
  }
  EXPECT_TRUE(json["coverage_g"]["min"].is_null());
  EXPECT_TRUE(json["coverage_g"]["max"].is_null());
  for (const char* key : {"before", "after", "rounded"}) {
    EXPECT_TRUE(json["residual_mg"].at(key).is_null()) << key;
  }
  EXPECT_EQ(json["verified"], false);
  EXPECT_EQ(json["points"], 0);
  for (const char* key : {"least_squares", "richer_model", "genetic", "temperature", "partial"}) {
    EXPECT_FALSE(json.contains(key)) << key << " was not asked for";
  }
}

SolveReport made_report() {
  SolveReport report;
  report.serial = "MOS2A45130450";
  report.filter = FilterConfiguration::legacy;
  report.method = SolveMethod::genetic;
  report.seconds = 1.25;
  report.calibration = Calibration{{0.004, 0.0041, 0.0042}, {1.5, -2.5, 3.5}};
  report.stored = StoredConstants{{251, 241, 241}, {-249, -247, -235}, {2, -2, 4}};
  report.uncertainty = {{0.001, 0.002, 0.003}, {1, 2, 3}};
  report.statistical = {{0.0001, 0.0002, 0.0003}, {0.1, 0.2, 0.3}};
  report.points = 120;
  report.points_found = 130;
  report.noisy_points = 7;
  report.coverage.min_g = {-1, -0.9, -0.8};
  report.coverage.max_g = {0.7, 0.6, 0.5};
  report.coverage.subset_blocks = {{{11, 12, 13}, {21, 22, 23}, {31, 32, 33}}};
  report.residual_before_mg = 90;
  report.residual_after_mg = 2.5;
  report.residual_rounded_mg = 3.5;
  report.gravity_g = 0.999;
  report.iterations = 17;
  report.notes = {"a note"};
  report.verification.verified = true;
  report.verification.verdict = Verdict::verified;
  report.verification.missing_directions = {"+x"};
  return report;
}

// Oracle: the numbers of made_report().
TEST(ReportJson, EveryNumberStandsUnderItsKey) {
  const Json json = to_json(made_report());
  EXPECT_EQ(json["serial"], "MOS2A45130450");
  EXPECT_EQ(json["filter"], "legacy");
  EXPECT_EQ(json["method"], "ga");
  EXPECT_EQ(json["constants"]["sensitivity_g_per_lsb"], Json({0.004, 0.0041, 0.0042}));
  EXPECT_EQ(json["constants"]["zero_lsb"], Json({1.5, -2.5, 3.5})) << "the unrounded zero holds";
  EXPECT_EQ(json["constants"]["positive_lsb"], Json({251, 241, 241}));
  EXPECT_EQ(json["constants"]["negative_lsb"], Json({-249, -247, -235}));
  EXPECT_EQ(json["constants"]["stored_zero_lsb"], Json({2, -2, 4}));
  EXPECT_EQ(json["standard_uncertainty"]["zero_mg"], Json({1, 2, 3}));
  EXPECT_EQ(json["standard_uncertainty"]["of_the_data_alone"]["zero_mg"], Json({0.1, 0.2, 0.3}));
  EXPECT_EQ(json["standard_uncertainty"]["of_the_data_alone"]["sensitivity_relative"],
            Json({0.0001, 0.0002, 0.0003}));
  EXPECT_EQ(json["points"], 120);
  EXPECT_EQ(json["points_found"], 130);
  EXPECT_EQ(json["noisy_points"], 7);
  EXPECT_EQ(json["coverage_g"]["min"], Json({-1, -0.9, -0.8}));
  EXPECT_EQ(json["coverage_g"]["max"], Json({0.7, 0.6, 0.5}));
  // ValueSubset: high, middle, low.
  EXPECT_EQ(json["coverage_g"]["value_subsets"]["high"], Json({11, 21, 31}));
  EXPECT_EQ(json["coverage_g"]["value_subsets"]["middle"], Json({12, 22, 32}));
  EXPECT_EQ(json["coverage_g"]["value_subsets"]["low"], Json({13, 23, 33}));
  EXPECT_EQ(json["residual_mg"], Json({{"before", 90}, {"after", 2.5}, {"rounded", 3.5}}));
  EXPECT_EQ(json["verified"], true);
  EXPECT_EQ(json["verdict"], "verified");
  EXPECT_EQ(json["missing_directions"], Json::array({"+x"}));
  EXPECT_EQ(json["notes"], Json::array({"a note"}));
  EXPECT_EQ(json["iterations"], 17);
  EXPECT_EQ(json["seconds"], 1.25);
  // 0.999 times the standard 9.80665 m/s2.
  EXPECT_NEAR(json["gravity_m_per_s2"].get<double>(), 9.79684335, 1e-9);
  EXPECT_EQ(json["from_prior"], false);
}

TEST(ReportJson, ConstantsThatFitNoMemoryAreShownWithoutTheNine) {
  SolveReport report = made_report();
  report.stored.reset();
  const Json json = to_json(report);
  EXPECT_TRUE(json["constants"].contains("zero_lsb"));
  EXPECT_FALSE(json["constants"].contains("positive_lsb"));
}

// A number that is not finite is null: JSON has no other word for it.
TEST(ReportJson, WhatIsNotFiniteIsNull) {
  SolveReport report = made_report();
  report.residual_after_mg = std::numeric_limits<double>::infinity();
  report.uncertainty.zero_mg[1] = std::numeric_limits<double>::quiet_NaN();
  const Json json = to_json(report);
  EXPECT_TRUE(json["residual_mg"]["after"].is_null());
  EXPECT_TRUE(json["standard_uncertainty"]["zero_mg"][1].is_null());
  EXPECT_EQ(json["standard_uncertainty"]["zero_mg"][2], 3);
}

// Oracle: numbers by hand. Terms that a model does not have are null, not zero.
TEST(ReportJson, TheFitAndItsRicherModel) {
  SolveReport report = made_report();
  report.fit.emplace();
  report.fit->fit.converged = true;
  report.fit->fit.condition = 4.5;
  report.fit->fit.degrees_of_freedom = 20;
  report.fit->blocks_left_out = 3;
  report.fit->block_sd_mg = 0.7;
  report.fit->structural_mg = 1.5;
  Json json = to_json(report);
  EXPECT_EQ(json["least_squares"], Json({{"converged", true},
                                         {"condition", 4.5},
                                         {"degrees_of_freedom", 20},
                                         {"blocks_left_out", 3},
                                         {"block_sd_mg", 0.7},
                                         {"structural_mg", 1.5}}));
  EXPECT_FALSE(json.contains("richer_model"));

  BlockFit::Richer richer;
  richer.fit.calibration = {{0.004, 0.004, 0.004}, {1, 2, 3}};
  richer.fit.model.cross_axis = true;
  richer.fit.cross_axis = {0.02, 0.003, -0.004};
  richer.fit.zero_lsb_per_c = {9, 9, 9};  // the model has none
  richer.held_out_rms_mg = 1.25;
  report.fit->richer = richer;
  json = to_json(report);
  EXPECT_EQ(json["richer_model"]["zero_lsb"], Json({1, 2, 3}));
  EXPECT_EQ(json["richer_model"]["cross_axis"], Json({0.02, 0.003, -0.004}));
  EXPECT_TRUE(json["richer_model"]["zero_lsb_per_c"].is_null());
  EXPECT_TRUE(json["richer_model"]["reference_temperature_c"].is_null());
  EXPECT_EQ(json["richer_model"]["held_out_rms_mg"], 1.25);

  report.fit->richer->fit.model = {false, true};
  report.fit->reference_temperature_c = 24.5;
  json = to_json(report);
  EXPECT_TRUE(json["richer_model"]["cross_axis"].is_null());
  EXPECT_EQ(json["richer_model"]["zero_lsb_per_c"], Json({9, 9, 9}));
  EXPECT_EQ(json["richer_model"]["reference_temperature_c"], 24.5);
}

TEST(ReportJson, TheBestSixTheTermsAndWhomToTrust) {
  SolveReport report = made_report();
  report.six.emplace();
  EXPECT_FALSE(to_json(report).contains("best_six")) << "no cross-axis terms, no choice";
  report.six->from = SixFrom::of_time;
  report.six->unseen_mg = BestSix::Unseen{11.5, 10.25, 7.125, 4.75, 60};
  report.six->elsewhere_mg = 55.5;
  report.cross_axis.emplace();
  report.cross_axis->cross_axis = {-0.019, 0.0, 0.008};
  report.cross_axis->unseen_mg = 4.75;
  report.cross_axis->six_unseen_mg = 7.125;
  report.trust = Trust{Trusted::least_squares, 1.5, "because"};
  const Json json = to_json(report);
  EXPECT_EQ(json["best_six"]["chosen"], "of_time");
  EXPECT_EQ(
      json["best_six"]["unseen_mg"],
      Json({{"of_sensor", 11.5}, {"of_directions", 10.25}, {"of_time", 7.125}, {"matrix", 4.75}}));
  EXPECT_EQ(json["best_six"]["unseen_directions"], 60);
  EXPECT_EQ(json["best_six"]["elsewhere_mg"], 55.5);
  EXPECT_EQ(json["cross_axis"]["xy_xz_yz"], Json({-0.019, 0.0, 0.008}));
  EXPECT_EQ(json["cross_axis"]["unseen_mg"]["six"], 7.125);
  EXPECT_EQ(json["cross_axis"]["verified"], false);
  EXPECT_EQ(json["trust"],
            Json({{"trusted", "least_squares"}, {"apart_mg", 1.5}, {"why", "because"}}));
  EXPECT_TRUE(json["temperature_c"].is_null()) << "no temperature was measured";
  report.fit.emplace();
  EXPECT_TRUE(to_json(report)["temperature_c"].is_null());
  report.fit->reference_temperature_c = 0.0;
  EXPECT_EQ(to_json(report)["temperature_c"], 0.0);
}

TEST(ReportJson, SearchTemperatureAndPartialKnowledge) {
  SolveReport report = made_report();
  report.search.emplace();
  report.search->settled = true;
  report.search->fitness_mg = {5, 4, 3};
  report.search->level_mg = 3.5;
  report.search->spread_mg = 0.5;
  report.search->trend_mg = -0.25;
  report.search->calibration = {{0.004, 0.004, 0.004}, {7, 8, 9}};
  report.temperature.emplace();
  report.temperature->low_c = 15;
  report.temperature->high_c = 40;
  report.temperature->zero_mg_per_c = {0.5, -0.25, 0.75};
  report.temperature->standard_uncertainty_mg_per_c = {0.1, 0.2, 0.3};
  report.temperature->blocks = 44;
  report.partial.emplace();
  report.partial->zero_mg = {4, 400, 4};
  report.partial->zero_determined = {true, false, true};
  report.partial->sensitivity_determined = {false, false, true};
  const Json json = to_json(report);
  EXPECT_EQ(json["genetic"]["settled"], true);
  EXPECT_EQ(json["genetic"]["fitness_mg"], Json({5, 4, 3}));
  EXPECT_EQ(json["genetic"]["trend_mg"], -0.25);
  EXPECT_EQ(json["genetic"]["constants"]["zero_lsb"], Json({7, 8, 9}));
  EXPECT_EQ(json["temperature"]["low_c"], 15);
  EXPECT_EQ(json["temperature"]["high_c"], 40);
  EXPECT_EQ(json["temperature"]["zero_mg_per_c"], Json({0.5, -0.25, 0.75}));
  EXPECT_EQ(json["temperature"]["standard_uncertainty_mg_per_c"], Json({0.1, 0.2, 0.3}));
  EXPECT_EQ(json["temperature"]["blocks"], 44);
  EXPECT_EQ(json["partial"]["zero_mg"], Json({4, 400, 4}));
  EXPECT_EQ(json["partial"]["zero_determined"], Json({true, false, true}));
  EXPECT_EQ(json["partial"]["sensitivity_determined"], Json({false, false, true}));
}

SixPoseReport made_jig_report() {
  SixPoseReport report;
  report.verified = true;
  report.chosen = SixPoseMethod::all_axes;
  report.better_by_mg = 4.5;
  report.as_published.calibration = {{0.004, 0.004, 0.004}, {1, 1, 1}};
  report.per_axis.calibration = {{0.004, 0.004, 0.004}, {2, 2, 2}};
  report.per_axis.held_out_rms_mg = 0.75;
  report.all_axes.six.calibration = {{0.004, 0.004, 0.004}, {3, 3, 3}};
  report.all_axes.lsb_per_g = {{{250, 1, 2}, {3, 251, 4}, {5, 6, 252}}};
  report.all_axes.cross_axis = {0.01, 0.02, 0.03};
  report.all_axes.rotation_deg = {0.1, 0.2, 0.3};
  report.all_axes.degrees_of_freedom = 24;
  report.poses = {{"+x", 0.5, 0.25, false}, {"-z", -1.5, 0.75, true}};
  report.midpoint_minus_zero_lsb = {2, 4, 7};
  report.gravity.m_per_s2 = 9.81;
  return report;
}

// Oracle: the numbers of made_jig_report().
TEST(ReportJson, TheJigsThreeSolutionsStandSideBySide) {
  const Json json = to_json(made_jig_report());
  EXPECT_EQ(json["verified"], true);
  EXPECT_EQ(json["chosen"], "vector");
  EXPECT_EQ(json["better_by_mg"], 4.5);
  EXPECT_EQ(json["letter"]["constants"]["zero_lsb"], Json({1, 1, 1}));
  EXPECT_EQ(json["pair"]["constants"]["zero_lsb"], Json({2, 2, 2}));
  EXPECT_EQ(json["vector"]["constants"]["zero_lsb"], Json({3, 3, 3}));
  EXPECT_EQ(json["pair"]["held_out_rms_mg"], 0.75);
  EXPECT_TRUE(json["letter"]["held_out_rms_mg"].is_null()) << "nothing was held out";
  EXPECT_EQ(json["vector"]["lsb_per_g"][1], Json({3, 251, 4}));
  EXPECT_EQ(json["vector"]["cross_axis"], Json({0.01, 0.02, 0.03}));
  EXPECT_EQ(json["vector"]["rotation_deg"], Json({0.1, 0.2, 0.3}));
  EXPECT_EQ(json["vector"]["degrees_of_freedom"], 24);
  EXPECT_EQ(json["midpoint_minus_zero_lsb"], Json({2, 4, 7}));
  EXPECT_EQ(json["gravity_m_per_s2"], 9.81);
  ASSERT_EQ(json["poses"].size(), 2U);
  EXPECT_EQ(json["poses"][1], Json({{"pose", "-z"},
                                    {"magnitude_mg", -1.5},
                                    {"tilt_deg", 0.75},
                                    {"held_out", true},
                                    {"chose", false}}));
}

// Without all six sides there are no constants to show.
TEST(ReportJson, AJigReportWithAMissingSideNamesItAndShowsNoConstants) {
  SixPoseReport report = made_jig_report();
  report.verified = false;
  report.reasons = {"a side is missing"};
  report.missing_directions = {"-y"};
  const Json json = to_json(report);
  EXPECT_EQ(json["missing_directions"], Json::array({"-y"}));
  EXPECT_EQ(json["reasons"], Json::array({"a side is missing"}));
  for (const char* key : {"chosen", "letter", "pair", "vector", "poses"}) {
    EXPECT_FALSE(json.contains(key)) << key;
  }
}

}  // namespace
}  // namespace sixpoint::calib
