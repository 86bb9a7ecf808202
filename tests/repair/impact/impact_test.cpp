#include "repair/impact/impact.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;

EpochSeries series_at(const std::vector<double>& enmo_mg) {
  EpochSeries series{"<a>.gt3x", 5, 30, true, {}};
  std::uint32_t time = 1'428'588'240;
  for (const double value : enmo_mg) {
    Epoch epoch;
    epoch.unix_time = time;
    epoch.samples = 150;
    epoch.enmo_mg = value;
    epoch.mad_mg = 2 * value;
    epoch.enmo_per_error = {0.6, 0, 0.8};
    epoch.counts = {3, 0, 4};
    series.epochs.push_back(epoch);
    time += 5;
  }
  return series;
}

TEST(Impact, SummaryByHand) {
  const EpochSeries series = series_at({50, 90, 110, 200});
  const std::vector<CutPoint> cuts = {{"much", Measure::enmo_mg, 100},
                                      {"any", Measure::counts_vm, 4}};
  const ImpactSummary summary = summary_of(series, PerAxis<double>{5, 7, 5}, cuts);
  EXPECT_EQ(summary.epochs, 4U);
  EXPECT_NEAR(summary.recorded_minutes, 20.0 / 60, 1e-12);
  EXPECT_NEAR(summary.enmo_mg, 112.5, 1e-12);
  EXPECT_NEAR(summary.mad_mg, 225, 1e-12);
  ASSERT_TRUE(summary.enmo_uncertainty_mg);
  EXPECT_NEAR(*summary.enmo_uncertainty_mg, 5, 1e-12) << "hypot of 3 and 4";
  ASSERT_TRUE(summary.counts_per_minute);
  EXPECT_NEAR((*summary.counts_per_minute)[2], 48, 1e-12);
  ASSERT_EQ(summary.minutes.size(), 2U);
  EXPECT_NEAR(summary.minutes[0].above, 10.0 / 60, 1e-12);
  EXPECT_NEAR(summary.minutes[0].least.value(), 5.0 / 60, 1e-12) << "110 - 10 is not above 100";
  EXPECT_NEAR(summary.minutes[0].most.value(), 10.0 / 60, 1e-12) << "90 + 10 is not above 100";
  EXPECT_NEAR(summary.minutes[1].above, 20.0 / 60, 1e-12) << "5 counts in every epoch";
  EXPECT_FALSE(summary.minutes[1].least) << "that of counts is not stated";
  EXPECT_FALSE(summary_of(series, std::nullopt, cuts).enmo_uncertainty_mg);
}

TEST(Impact, CutPointsAreReadOrRefused) {
  const auto cut = parse_cut_point("light=mad_mg:22.5");
  ASSERT_OK(cut);
  EXPECT_EQ(cut->name, "light");
  EXPECT_EQ(cut->measure, Measure::mad_mg);
  EXPECT_EQ(cut->value, 22.5);
  const auto plain = parse_cut_point("moderate=100");
  ASSERT_OK(plain);
  EXPECT_EQ(plain->measure, Measure::enmo_mg);
  EXPECT_EQ(plain->value, 100);
  for (const char* bad : {"", "moderate", "=3", "a=", "a=x", "a=3 ", "a=-1", "a=nan", "a=1e999",
                          "a=enmo:3", "a=enmo_mg:"}) {
    SCOPED_TRACE(bad);
    EXPECT_FAILS(parse_cut_point(bad), ErrorCode::usage);
  }
}

TEST(Impact, WhatHasNothingInCommonIsRefused) {
  Impact impact;
  impact.before = series_at({1, 2});
  impact.after = series_at({1, 2});
  EXPECT_OK(check(impact));
  impact.after->epochs[0].unix_time += 1000;
  impact.after->epochs[1].unix_time += 1000;
  EXPECT_FAILS(check(impact), ErrorCode::bad_data);
  impact.after = series_at({1, 2});
  impact.after->has_counts = false;
  impact.cuts = {{"many", Measure::counts_y, 10}};
  EXPECT_FAILS(check(impact), ErrorCode::usage);
}

TEST(Impact, TableJsonCsvAndPageSayTheSame) {
  Impact impact;
  impact.before = series_at({100, 120});
  impact.after = series_at({10, 20});
  impact.after_uncertainty_mg = PerAxis<double>{1, 1, 1};
  impact.cuts = {{"much", Measure::enmo_mg, 50}};
  EXPECT_THAT(impact.brief(), HasSubstr("ENMO, mean, mg"));
  EXPECT_THAT(impact.brief(), HasSubstr("110.00"));
  EXPECT_THAT(impact.brief(), HasSubstr("15.00 (+- 1.00)"));
  const nlohmann::ordered_json json = impact.to_json();
  EXPECT_EQ(json["epoch_s"], 5);
  EXPECT_EQ(json["epochs"], 2);
  EXPECT_NEAR(json["enmo_mg"]["before"].get<double>(), 110, 1e-9);
  EXPECT_NEAR(json["enmo_mg"]["after"].get<double>(), 15, 1e-9);
  EXPECT_NEAR(json["counts"]["z"]["after"].get<double>(), 48, 1e-9);
  EXPECT_NEAR(json["minutes_above"]["much"]["before"].get<double>(), 10.0 / 60, 1e-12);
  EXPECT_EQ(json["minutes_above"]["much"]["after"], 0);
  EXPECT_TRUE(json["enmo_uncertainty_mg"]["before"].is_null());
  const std::string csv = impact_csv(impact);
  EXPECT_EQ(csv.substr(0, csv.find('\n')),
            "unix_time,time,before_samples,before_enmo_mg,before_mad_mg,before_counts_x,"
            "before_counts_y,before_counts_z,after_samples,after_enmo_mg,after_mad_mg,"
            "after_counts_x,after_counts_y,after_counts_z");
  EXPECT_THAT(csv, HasSubstr("1428588245,2015-04-09T14:04:05,150,120.000,240.000,3,0,4,"
                             "150,20.000,40.000,3,0,4\n"));
  const std::string page = impact_html(impact);
  EXPECT_THAT(page, HasSubstr("&lt;a&gt;.gt3x"));
  EXPECT_THAT(page, HasSubstr("15.00 (+- 1.00)"));
  EXPECT_EQ(page.find("http"), std::string::npos) << "nothing to load";
}

TEST(Impact, OneRecordingAlone) {
  Impact impact;
  impact.before = series_at({100, 120});
  EXPECT_OK(check(impact));
  EXPECT_TRUE(impact.to_json()["enmo_mg"]["after"].is_null());
  EXPECT_THAT(impact_csv(impact), testing::StartsWith("unix_time,time,samples,enmo_mg,"));
}

}  // namespace
}  // namespace sixpoint::repair
