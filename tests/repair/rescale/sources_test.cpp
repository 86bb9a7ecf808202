#include "repair/rescale/sources.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "repair/jig_constants.h"

namespace sixpoint::repair {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr auto kConstantsFile = SourceKind::constants;
constexpr auto kCalibrationFile = SourceKind::calibration_file;
constexpr auto kScan = SourceKind::scan;
constexpr auto kStore = SourceKind::store;

TEST(Sources, TheOrderByItsTable) {
  const bool yes = true;
  const bool no = false;
  EXPECT_THAT(sources_in_order({yes, yes, yes, yes, no, no}), ElementsAre(kConstantsFile));
  EXPECT_THAT(sources_in_order({no, yes, yes, yes, no, no}), ElementsAre(kCalibrationFile));
  EXPECT_THAT(sources_in_order({no, no, yes, yes, no, no}), ElementsAre(kScan));
  EXPECT_THAT(sources_in_order({no, no, no, yes, no, no}), ElementsAre(kStore));
  EXPECT_THAT(sources_in_order({no, no, no, no, no, yes}), ElementsAre(kStore, kScan));
  EXPECT_THAT(sources_in_order(NamedSources{}), ElementsAre(kScan));
  EXPECT_THAT(sources_in_order({yes, yes, yes, yes, yes, yes}), ElementsAre(kConstantsFile, kScan));
  EXPECT_THAT(sources_in_order({no, yes, no, no, yes, yes}), ElementsAre(kCalibrationFile, kScan));
  EXPECT_THAT(sources_in_order({no, no, no, yes, yes, no}), ElementsAre(kStore, kScan));
  EXPECT_THAT(sources_in_order({no, no, yes, no, yes, yes}), ElementsAre(kScan));
}

TEST(Sources, TheUnitsOtherFilesAreAskedBehindTheFilesOwnStillPeriods) {
  NamedSources named;
  named.unit_files = true;
  EXPECT_THAT(sources_in_order(named), ElementsAre(kScan, SourceKind::unit_files));
  named.default_store = true;
  EXPECT_THAT(sources_in_order(named), ElementsAre(kStore, kScan, SourceKind::unit_files));
  named.constants = true;
  EXPECT_THAT(sources_in_order(named), ElementsAre(kConstantsFile));
  named.or_scan = true;
  EXPECT_THAT(sources_in_order(named), ElementsAre(kConstantsFile, kScan, SourceKind::unit_files));
}

TEST(Sources, ADefaultStoreIsNeverAskedBesideSomethingNamed) {
  for (int named = 1; named < 16; ++named) {
    NamedSources sources;
    sources.constants = (named & 1) != 0;
    sources.calibration_file = (named & 2) != 0;
    sources.scan = (named & 4) != 0;
    sources.store = (named & 8) != 0;
    const auto alone = sources_in_order(sources);
    sources.default_store = true;
    EXPECT_EQ(sources_in_order(sources), alone) << named;
  }
}

TEST(Sources, WhatDoesNotFitIsSaid) {
  auto record = calib::parse_constants_record(tests::kConstants).value();
  const FileFacts file = {record.serial, "1.5.0", std::nullopt};
  EXPECT_EQ(why_unfit(record, file, false), std::nullopt);
  const calib::Calibration right = record.calibration;
  record.calibration.sensitivity_g_per_lsb[0] *= 10;
  EXPECT_THAT(why_unfit(record, file, true).value(), HasSubstr("23.81 LSB/g on its x axis"));
  record.calibration = right;
  record.calibration.zero_lsb[2] = 200;
  EXPECT_THAT(why_unfit(record, file, true).value(), HasSubstr("a zero of 0.82 g on its z axis"));
  record.calibration = right;
  record.cross_axis.emplace();
  record.cross_axis->calibration = right;
  EXPECT_EQ(why_unfit(record, file, false), std::nullopt);
  record.cross_axis->calibration.sensitivity_g_per_lsb[1] = 1.0 / 360;
  EXPECT_THAT(why_unfit(record, file, true).value(), HasSubstr("360 LSB/g on its y axis"));
  record.cross_axis.reset();
  record.from_prior = true;
  EXPECT_THAT(why_unfit(record, file, false).value(), HasSubstr("--allow-prior"));
  EXPECT_EQ(why_unfit(record, file, true), std::nullopt);
  record.filter = calib::FilterConfiguration::legacy;
  EXPECT_THAT(why_unfit(record, file, true).value(), HasSubstr("legacy"));
  record.serial = "MOS2A99999999";
  EXPECT_THAT(why_unfit(record, file, true).value(), HasSubstr("MOS2A99999999"));
}

TEST(Sources, ADigestNamesWhatTheConstantsDo) {
  const auto record = calib::parse_constants_record(tests::kConstants).value();
  auto other = record;
  other.made_at = from_unix_seconds(1);
  other.method = "jig";
  EXPECT_EQ(digest_of(record), digest_of(other)) << "when and how makes no difference to a file";
  EXPECT_EQ(digest_of(record).size(), 32U);
  other.calibration.zero_lsb[1] += 1e-9;
  EXPECT_NE(digest_of(record), digest_of(other));
  other = record;
  other.serial = "MOS2A99999999";
  EXPECT_NE(digest_of(record), digest_of(other));
}

TEST(Sources, WhatWasUsedIsReadAgainAsItWasWritten) {
  auto record = calib::parse_constants_record(tests::kConstants).value();
  const SourceUsed plain = source_used("constants", "", record);
  EXPECT_EQ(plain.id, digest_of(record));
  EXPECT_FALSE(plain.made_at) << "the file does not say";
  EXPECT_FALSE(plain.standard_uncertainty_mg);
  record.made_at = from_unix_seconds(1'700'000'000);
  record.uncertainty.zero_mg = {1, 2, 1.5};
  const SourceUsed used = source_used("store", "0123456789abcdef0123456789abcdef", record);
  EXPECT_EQ(used.brief(), "store 0123456789ab (2023-11-14, +- 2.0 mg)");
  for (const SourceUsed& one : {plain, used}) {
    const auto again = parse_source_used(one.to_json());
    ASSERT_TRUE(again);
    EXPECT_EQ(again->to_json(), one.to_json());
  }
  EXPECT_FALSE(parse_source_used(nullptr));
}

TEST(Sources, KindsHaveTheNamesOfTheContract) {
  using Row = std::pair<SourceKind, const char*>;
  for (const auto& [kind, name] :
       {Row{kConstantsFile, "constants"}, Row{kCalibrationFile, "calibration_file"},
        Row{kScan, "scan"}, Row{kStore, "store"}, Row{SourceKind::unit_files, "unit_files"}}) {
    EXPECT_EQ(to_string(kind), name);
  }
}

}  // namespace
}  // namespace sixpoint::repair
