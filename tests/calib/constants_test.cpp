#include "calib/constants.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"

namespace sixpoint::calib {
namespace {

ConstantsRecord example() {
  ConstantsRecord record;
  record.serial = "MOS2A45130450";
  record.filter = FilterConfiguration::current;
  record.calibration = {{0.00420, 0.00397, 0.00413}, {49.9, 95.8, 60.8}};
  record.stored = {{288, 348, 303}, {-188, -156, -181}, {50, 96, 61}};
  record.uncertainty = {{0.001, 0.0011, 0.0012}, {0.5, 0.6, 0.7}};
  record.method = "least_squares";
  record.made_at = *parse_iso8601("2016-05-16T12:00:00Z");
  record.made_from.sha256 = std::string(64, 'a');
  record.gravity_m_per_s2 = 9.81;
  return record;
}

TEST(Constants, EquationsOneToSix) {
  const auto calibration = calibration_from({{311, 310, 287}, {-204, -216, -234}, {54, 47, 26}});
  ASSERT_OK(calibration);
  EXPECT_DOUBLE_EQ(calibration->sensitivity_g_per_lsb[0], 2.0 / 515);
  EXPECT_DOUBLE_EQ(calibration->zero_lsb[2], 26);
  // Zero is not the midpoint (53.5): at +1 g this unit reads 2 * 257 / 515.
  EXPECT_DOUBLE_EQ(calibration->to_g(0, 311), 2.0 * 257 / 515);
}

TEST(Constants, RecordSurvivesTheFile) {
  const ConstantsRecord record = example();
  const auto back = parse_constants_record(to_json(record).dump());
  ASSERT_OK(back);
  EXPECT_EQ(back->serial, record.serial);
  EXPECT_EQ(back->filter, record.filter);
  EXPECT_EQ(back->calibration, record.calibration);
  EXPECT_EQ(back->stored, record.stored);
  EXPECT_EQ(back->uncertainty.zero_mg, record.uncertainty.zero_mg);
  EXPECT_EQ(back->method, record.method);
  EXPECT_EQ(back->made_at, record.made_at);
  EXPECT_EQ(back->made_from.sha256, record.made_from.sha256);
  EXPECT_DOUBLE_EQ(back->gravity_m_per_s2, 9.81);
  EXPECT_FALSE(back->from_prior);
  EXPECT_NE(record.brief().find("MOS2A45130450"), std::string::npos);
}

CrossAxisMap example_map() {
  CrossAxisMap map;
  map.calibration = {{0.00421, 0.00396, 0.00414}, {49.1, 95.2, 61.3}};
  map.cross_axis = {-0.019, 0.0004, 0.0079};
  map.cross_axis_sd = {0.0003, 0.0002, 0.0004};
  map.uncertainty = {{0.0011, 0.0012, 0.0013}, {0.4, 0.5, 0.6}};
  map.unseen_directions = 60;
  map.unseen_mg = 3.6;
  map.six_unseen_mg = 7.1;
  map.verified = true;
  return map;
}

TEST(Constants, CrossAxisTermsSurviveTheFile) {
  ConstantsRecord record = example();
  record.cross_axis = example_map();
  const auto back = parse_constants_record(to_json(record).dump());
  ASSERT_OK(back);
  ASSERT_TRUE(back->cross_axis);
  EXPECT_EQ(back->cross_axis->calibration, record.cross_axis->calibration);
  EXPECT_EQ(to_json(*back->cross_axis), to_json(*record.cross_axis));
  // A reader of six constants finds the six where they always were.
  EXPECT_EQ(back->calibration, record.calibration);
  nlohmann::ordered_json without = to_json(record);
  without.erase("cross_axis");
  EXPECT_EQ(without, to_json(example()));
}

// Oracle: the three rows of the matrix, written out.
TEST(Constants, TheMatrixIsSymmetric) {
  CrossAxisMap map = example_map();
  map.calibration = {{0.004, 0.004, 0.004}, {10, 20, 30}};
  const PerAxis<double> g = map.to_g({260, 20, 30});  // u = 1, 0, 0
  EXPECT_NEAR(g[0], 1, 1e-12);
  EXPECT_NEAR(g[1], -0.019, 1e-12);
  EXPECT_NEAR(g[2], 0.0004, 1e-12);
  EXPECT_NEAR(map.to_g({10, 20, 280})[1], 0.0079, 1e-12);
}

TEST(Constants, HalfACrossAxisMapIsRefused) {
  ConstantsRecord record = example();
  record.cross_axis = example_map();
  const nlohmann::ordered_json whole = to_json(record);
  for (const auto& [key, value] : whole["cross_axis"].items()) {
    auto less = whole;
    less["cross_axis"].erase(key);
    SCOPED_TRACE(key);
    EXPECT_FAILS(constants_record_from_json(less), ErrorCode::bad_data);
    auto wrong = whole;
    wrong["cross_axis"][key] = "no";
    EXPECT_FAILS(constants_record_from_json(wrong), ErrorCode::bad_data);
  }
  auto absurd = whole;
  absurd["cross_axis"]["xy_xz_yz"][1] = 0.5;
  EXPECT_FAILS(constants_record_from_json(absurd), ErrorCode::bad_data);
}

TEST(Constants, AnUncertaintyBelowZeroIsRefused) {
  ConstantsRecord record = example();
  record.cross_axis = example_map();
  const nlohmann::ordered_json whole = to_json(record);
  ASSERT_OK(constants_record_from_json(whole));
  const auto expect_refused = [&](const char* part, const char* key) {
    auto wrong = whole;
    wrong[part][key][1] = -1;
    const auto read = constants_record_from_json(wrong);
    EXPECT_FAILS(read, ErrorCode::bad_data);
    EXPECT_NE(read.error().brief().find(key), std::string::npos) << read.error().brief();
  };
  expect_refused("standard_uncertainty", "zero_mg");
  expect_refused("standard_uncertainty", "sensitivity_relative");
  expect_refused("cross_axis", "zero_mg_uncertainty");
  expect_refused("cross_axis", "sensitivity_relative_uncertainty");
  expect_refused("cross_axis", "standard_uncertainty");
}

TEST(Constants, TheNineIntegersAloneAreEnough) {
  const auto record = parse_constants_record(
      R"({"serial":"MOS2A45130450","filter":"legacy","constants":)"
      R"({"positive_lsb":[311,310,287],"negative_lsb":[-204,-216,-234],"zero_lsb":[54,47,26]}})");
  ASSERT_OK(record);
  EXPECT_DOUBLE_EQ(record->calibration.sensitivity_g_per_lsb[0], 2.0 / 515);
  EXPECT_EQ(record->filter, FilterConfiguration::legacy);
}

TEST(Constants, DamagedFilesAreRefused) {
  const std::string good = to_json(example()).dump();
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"\"MOS2A45130450\"", "\"\""},
                                                        {"\"current\"", "\"new\""},
                                                        {"0.0042,", "null,"},
                                                        {"0.0042,", "-0.0042,"},
                                                        {"0.0042,", ""},
                                                        {"49.9", "1e9"},
                                                        {"288", "-4000"},
                                                        {"288", "-188"},
                                                        {"288", "1.5"},
                                                        {"9.81", "1.62"},
                                                        {"2016-05-16", "2016-15-16"}}) {
    std::string damaged = good;
    const auto at = damaged.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    damaged.replace(at, from.size(), to);
    EXPECT_FAILS(parse_constants_record(damaged), ErrorCode::bad_data);
  }
  for (const char* text : {"", "[]", "null", "{}", "{\"serial\":3}", "\xff\xfe"}) {
    EXPECT_FAILS(parse_constants_record(text), ErrorCode::bad_data);
  }
  EXPECT_FAILS(parse_constants_record(std::string(100'000, '[')), ErrorCode::bad_data);
  EXPECT_EQ(parse_constants_record("{\n\"zero_lsb\": [NaN, 1, 2]}").error().what,
            "is not JSON: line 2 at 'N'");
}

TEST(Constants, NearestStoredIsWithinHalfACount) {
  const Calibration calibration = example().calibration;
  const auto stored = nearest_stored(calibration);
  ASSERT_OK(stored);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_LE(std::abs(stored->zero_lsb[a] - calibration.zero_lsb[a]), 0.5);
    EXPECT_LE(std::abs(stored->positive_lsb[a] - stored->negative_lsb[a] -
                       2 / calibration.sensitivity_g_per_lsb[a]),
              0.5);
  }
  Calibration flat = calibration;
  flat.sensitivity_g_per_lsb[0] = 1.0 / 3000;
  EXPECT_FAILS(nearest_stored(flat), ErrorCode::bad_data);
}

TEST(Constants, FilterNames) {
  for (const auto filter : {FilterConfiguration::legacy, FilterConfiguration::current}) {
    EXPECT_EQ(*parse_filter_configuration(to_string(filter)), filter);
  }
  EXPECT_FAILS(parse_filter_configuration("Legacy"), ErrorCode::usage);
}

}  // namespace
}  // namespace sixpoint::calib
