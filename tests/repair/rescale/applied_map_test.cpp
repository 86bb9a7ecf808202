#include "repair/rescale/applied_map.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "base/random.h"
#include "calib/free_living.h"
#include "expect_result.h"
#include "repair/rescale/constants_finder.h"
#include "repair/six_sides.h"
#include "shared_data.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

calib::ConstantsRecord crossed_record() {
  calib::ConstantsRecord record;
  record.serial = "MOS2A45130450";
  record.calibration = tests::kTrue;
  record.stored = calib::nearest_stored(tests::kTrue).value();
  record.uncertainty = {{0.001, 0.001, 0.001}, {1, 2, 3}};
  calib::CrossAxisMap map;
  map.calibration = {{0.0042, 0.00398, 0.00413}, {95, 52, 91}};
  map.cross_axis = {-0.02, 0.001, 0.008};
  map.cross_axis_sd = {0.0004, 0.0003, 0.0005};
  map.uncertainty = {{0.0011, 0.0012, 0.0013}, {0.4, 0.5, 0.6}};
  map.unseen_directions = 60;
  map.unseen_mg = 3;
  map.six_unseen_mg = 8;
  map.verified = true;
  record.cross_axis = map;
  return record;
}

Survey surveyed() {
  Survey survey;
  survey.accel_scale_lsb_per_g = 256;
  survey.constants = {tests::kStored};
  return survey;
}

TEST(AppliedMap, TermsWhereTheyAreBetterElseTheSix) {
  calib::ConstantsRecord record = crossed_record();
  const AppliedMap with = applied_map(record, surveyed());
  EXPECT_TRUE(with.has_terms());
  EXPECT_EQ(with.calibration, record.cross_axis->calibration);
  EXPECT_EQ(with.cross_axis, record.cross_axis->cross_axis);
  EXPECT_THAT(with.why, testing::HasSubstr("are applied"));
  record.cross_axis->unseen_mg = 7.9;
  const AppliedMap without = applied_map(record, surveyed());
  EXPECT_FALSE(without.has_terms());
  EXPECT_EQ(without.calibration, record.calibration);
  EXPECT_THAT(without.why, testing::HasSubstr("not applied"));
  // Terms of 2 % that are known and left out make 12 mg on x.
  EXPECT_GT((*without.sample_uncertainty_mg)[0], (*with.sample_uncertainty_mg)[0] + 8);
}

TEST(AppliedMap, UncertaintyOfSamplesIsThatOfTheConstantsThatAreApplied) {
  calib::ConstantsRecord record = crossed_record();
  record.cross_axis.reset();
  const AppliedMap map = applied_map(record, surveyed());
  EXPECT_EQ(map.why, "");
  ASSERT_TRUE(map.sample_uncertainty_mg);
  // By hand: zero 3 mg, a third of (1 mg)^2, a sensor's count of 4.13 mg and the rounding's 3.91
  // mg, each over the root of 12. The file's slope on z is above 1: its counts are whole.
  const double z_mg =
      std::sqrt(9 + 1 / 3.0 + (std::pow(1000 / 242.3, 2) + std::pow(3.90625, 2)) / 12);
  EXPECT_NEAR((*map.sample_uncertainty_mg)[2], z_mg, 1e-9);
  Survey other = surveyed();
  other.plausibility = {100'000, 3'000};  // the affine map
  EXPECT_GT((*applied_map(record, other).sample_uncertainty_mg)[2], z_mg + 0.1);
  record.uncertainty = {};
  EXPECT_FALSE(applied_map(record, surveyed()).sample_uncertainty_mg) << "none is stated";
}

TEST(AppliedMap, SourcesAreComparedByTheSensorsOwnSix) {
  const calib::ConstantsRecord record = crossed_record();
  const SensorsOwn own = sensors_own(record.calibration, record.uncertainty, record.cross_axis);
  EXPECT_EQ(own.calibration, record.cross_axis->calibration);
  EXPECT_EQ(own.uncertainty.zero_mg, record.cross_axis->uncertainty.zero_mg);
  EXPECT_EQ(sensors_own(record.calibration, record.uncertainty, {}).calibration,
            record.calibration);
  auto unverified = record.cross_axis;
  unverified->verified = false;
  EXPECT_EQ(sensors_own(record.calibration, record.uncertainty, unverified).calibration,
            record.calibration);
}

// What a sensor with 2 % between x and y reads that lay in sixty directions, ten seconds in each.
tests::MadeRecording crossed_rests() {
  tests::MadeRecording made;
  Random random(8);
  for (int pose = 0; pose < 60; ++pose) {
    PerAxis<double> up = {random.normal(), random.normal(), random.normal()};
    const double length = std::hypot(up[0], up[1], up[2]);
    for (double& value : up) {
      value /= length;
    }
    for (int i = 0; i < 300; ++i) {
      PerAxis<double> g = {up[0] + 0.02 * up[1], up[1] + 0.02 * up[0], up[2]};
      for (double& value : g) {
        value += 0.004 * random.normal();
      }
      made.raw.push_back(tests::sense(g));
    }
  }
  return made;
}

TEST(AppliedMap, AFileOfASensorWithCrossAxisIsRepairedWithTheTerms) {
  MemoryEnv memory;
  ASSERT_OK(crossed_rests().write(memory.files, "in.gt3x"));
  ConstantsFinder finder(memory.env, {});
  const RepairReport report = repair_file(memory.env, "in.gt3x", "out.gt3x", finder, {});
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_TRUE(report.cross_axis_applied);
  EXPECT_LT(*report.still_error_after_mg, 1.5);  // 5 mg with the best six constants
  EXPECT_THAT(report.reasons,
              testing::Contains(testing::HasSubstr("cross-axis terms are applied")));
  const Json json = report.to_json();
  const Bytes mark_bytes = tests::entry_of(memory.files, "out.gt3x", kRepairMark);
  const Json mark = Json::parse(mark_bytes.begin(), mark_bytes.end());
  for (const Json& document : {json, mark}) {
    EXPECT_EQ(document["cross_axis_applied"], true);
    ASSERT_EQ(document["sample_uncertainty_mg"].size(), 3U);
    for (const Json& mg : document["sample_uncertainty_mg"]) {
      EXPECT_GT(mg.get<double>(), 1.5);  // two roundings of about 1.1 mg
      EXPECT_LT(mg.get<double>(), 4);
    }
  }
  EXPECT_NEAR(mark["constants_after"]["cross_axis"]["xy_xz_yz"][0].get<double>(), -0.02, 0.002);
  // Of the terms that are applied; the six constants are far from the sensor's own.
  ASSERT_TRUE(report.source);
  EXPECT_LT(*report.source->standard_uncertainty_mg, 4);
  // A later run that finds the output answers the same.
  RepairOptions resume;
  resume.resume = true;
  const RepairReport again = repair_file(memory.env, "in.gt3x", "out.gt3x", finder, resume);
  EXPECT_TRUE(again.resumed);
  EXPECT_TRUE(again.cross_axis_applied);
  EXPECT_EQ(again.sample_uncertainty_mg, report.sample_uncertainty_mg);
}

// The document of the store's row is constants.json, terms included.
TEST(AppliedMap, TermsComeBackFromTheStore) {
  MemoryEnv memory;
  ASSERT_OK(crossed_rests().write(memory.files, "in.gt3x"));
  auto store = db::Store::in_memory(memory.env).value();
  db::ConstantsRecord row;
  row.made_at = from_unix_seconds(1'700'000'000);
  row.serial = "MOS2A45130450";
  row.filter = "current";
  row.method = "ls";
  row.document = calib::to_json(crossed_record()).dump();
  ASSERT_OK(store.add_constants(row, ""));
  ConstantsFinderOptions options;
  options.store = &store;
  ConstantsFinder finder(memory.env, options);
  const auto choice = finder.choose("in.gt3x", survey(memory.files, "in.gt3x").value()).value();
  ASSERT_TRUE(choice.chosen);
  ASSERT_TRUE(choice.chosen->record.cross_axis);
  EXPECT_EQ(calib::to_json(*choice.chosen->record.cross_axis),
            calib::to_json(*crossed_record().cross_axis));
  EXPECT_NEAR(*source_used("store", "x", crossed_record()).standard_uncertainty_mg,
              std::hypot(0.6, 1.3), 1e-9)
      << "of the terms: zero and sensitivity of z at 1 g";
  // Terms make another set of constants.
  auto other = crossed_record();
  other.cross_axis->cross_axis[0] = 0.01;
  EXPECT_NE(digest_of(other), digest_of(crossed_record()));
}

// The real free-living day as an affected unit would have stored it, repaired by its own still
// periods. Oracle: GGIR's windows and GGIR's error of its own six constants (3.89 mg).
TEST(AppliedMap, TheRealDayIsRepairedBetterThanSixConstantsCan) {
  SIXPOINT_NEED_SHARED("data/autocalibration/agcounts_20h_30hz.csv.gz");
  tests::MadeRecording made;
  for (const auto& count : tests::free_living_counts()) {
    made.raw.push_back({count[0], count[1], count[2]});
  }
  ASSERT_GT(made.raw.size(), 2'000'000U);
  MemoryEnv memory;
  ASSERT_OK(made.write(memory.files, "day.gt3x"));
  ConstantsFinder finder(memory.env, {});
  const RepairReport report = repair_file(memory.env, "day.gt3x", "out.gt3x", finder, {});
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_TRUE(report.cross_axis_applied);
  const auto error = [&](const std::string& path) {
    return tests::mean_error_mg(
        tests::ggir_windows(tests::samples_of(memory.files, path)),
        [](const PerAxis<double>& mean) {
          return PerAxis<double>{mean[0] / 256, mean[1] / 256, mean[2] / 256};
        });
  };
  const double after_mg = error("out.gt3x");
  std::printf("real day as .gt3x, GGIR's windows: %.2f mg before, %.2f mg after the repair\n",
              error("day.gt3x"), after_mg);
  EXPECT_LE(after_mg, 3.6);
}

}  // namespace
}  // namespace sixpoint::repair
