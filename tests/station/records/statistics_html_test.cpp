// The page of statistics and its charts.
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "expect_result.h"
#include "station/records/made_station.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::Not;

class StatisticsHtml : public tests::StationRecords {};

TEST_F(StatisticsHtml, ThePageHoldsWhatItSaysAndEscapesNames) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("CHECK1", JigVerdict::pass, 110);
  for (int i = 0; i < 6; ++i) {
    add_run("MOS2A" + std::to_string(i), i == 0 ? JigVerdict::fail : JigVerdict::pass, 90 + i,
            "<script>alert(1)</script>");
  }
  const auto report = statistics(*summaries(store_, {}), "station");
  const auto state = station_state(store_, "A", default_limits().check_unit);
  const std::string html = statistics_html(*report, {*state});
  EXPECT_THAT(html, HasSubstr("83.3 %"));
  EXPECT_THAT(html, HasSubstr("zero_high"));
  EXPECT_THAT(html, HasSubstr("class=locked"));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
}

// How often `part` stands in `text`.
std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

StatisticsReport made_report() {
  StatisticsReport report;
  report.by = "operator";
  GroupStatistics ada;
  ada.name = "Ada";
  ada.runs = 12;
  ada.units = 10;
  ada.yield = {9, 10, 0.596, 0.982};
  ada.first_pass_yield = {8, 10, 0.49, 0.943};
  ada.seconds_per_unit_median = 93.5;
  report.groups = {ada, {}};
  report.all = ada;
  report.all.name = "all";
  report.all.failure_codes = {{"zero_high", 4}, {"zero_low", 1}};
  Capability capability;
  capability.n = 10;
  capability.mean = 12.5;
  capability.sd = 3.25;
  capability.cpk = 1.33;
  capability.cpk_low = 0.71;
  capability.cpk_high = 1.95;
  report.capabilities = {{"zero_offset_mg x", capability}};
  return report;
}

// Oracle: the numbers of made_report().
TEST(StatisticsPage, ARowHasTheNumbersOfItsGroup) {
  const std::string html = statistics_html(made_report(), {});
  EXPECT_THAT(html, HasSubstr("<tr><th scope=row>Ada</th><td>12</td><td>10</td><td>90.0 % "
                              "<small>(9 of 10; 59.6 to 98.2 %)</small></td><td>80.0 % "
                              "<small>(8 of 10; 49.0 to 94.3 %)</small></td><td>93.5 s</td></tr>"));
  EXPECT_THAT(html, HasSubstr("<th>operator</th>"));
  EXPECT_THAT(html, HasSubstr("<i>not stated</i></th><td>0</td>")) << "a group without a name";
  EXPECT_EQ(count_of(html, "<tr><th scope=row>"), 3U + 2U + 1U)
      << "two groups and all, two codes, one quantity";
}

// Oracle: the longest bar has 320 px; one run of four is a quarter of it.
TEST(StatisticsPage, BarsAreAsLongAsTheirCountsAndSayWhatToDo) {
  const std::string html = statistics_html(made_report(), {});
  EXPECT_THAT(html, HasSubstr("<rect width=320.0 height=14"));
  EXPECT_THAT(html, HasSubstr("<rect width=80.0 height=14"));
  const FailureCode* known = find_failure_code("zero_high");
  ASSERT_NE(known, nullptr);
  EXPECT_THAT(html, HasSubstr(std::string(known->next_action)));
  StatisticsReport good = made_report();
  good.all.failure_codes.clear();
  EXPECT_THAT(statistics_html(good, {}), HasSubstr("No run failed."));
}

TEST(StatisticsPage, ACapabilityHasItsIntervalAndNoCpWithoutTwoLimits) {
  StatisticsReport report = made_report();
  EXPECT_THAT(statistics_html(report, {}),
              HasSubstr("<td>10</td><td>12.5</td><td>3.25</td><td>\u2013</td><td>1.33 "
                        "<small>(0.71 to 1.95)</small></td>"));
  report.capabilities[0].second.cp = 1.5;
  EXPECT_THAT(statistics_html(report, {}), HasSubstr("<td>1.50</td><td>1.33 "));
  EXPECT_THAT(statistics_html(report, {}), Not(HasSubstr("different limits")));
  report.limits_differ = {"zero_offset_mg y"};
  EXPECT_THAT(statistics_html(report, {}), HasSubstr("no Cpk, for units were judged by different"));
}

// Nothing that no one measured: a dash, not "nan".
TEST(StatisticsPage, WhatIsNotKnownIsADash) {
  StatisticsReport report;
  report.all.seconds_per_unit_median = std::numeric_limits<double>::quiet_NaN();
  const std::string html = statistics_html(report, {});
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  EXPECT_THAT(html, HasSubstr("<td>\u2013</td><td>\u2013</td><td>\u2013</td>"));
}

CheckUnitChart made_chart() {
  std::vector<double> values(10, 100.0);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] += i % 2 == 0 ? 0.5 : -0.5;
  }
  values.push_back(100);
  values.push_back(110);  // beyond three sigma
  CheckUnitChart one;
  one.serial = "CHECK<1>";
  one.chart = control_chart("zero_offset_mg x", values, 10);
  for (std::size_t i = 0; i < values.size(); ++i) {
    one.times.push_back(*parse_iso8601("2026-01-01") + std::chrono::hours(24 * i));
  }
  return one;
}

// Oracle: the chart's points by hand: twelve values, of which the last breaks Nelson's first rule;
// colour is never alone, so its mark is a square with the rule's number.
TEST(StatisticsPage, AChartHasAMarkForEachPointAndASquareWhereARuleIsBroken) {
  const std::string svg = chart_svg(made_chart());
  EXPECT_EQ(count_of(svg, "<circle"), 11U);
  EXPECT_EQ(count_of(svg, "fill='#b71c1c'"), 1U);
  EXPECT_EQ(count_of(svg, "<polyline"), 2U) << "values, and their moving ranges";
  EXPECT_THAT(svg, HasSubstr("2026-01-01"));
  EXPECT_THAT(svg, HasSubstr("2026-01-12"));
  EXPECT_THAT(svg, HasSubstr("baseline"));
  EXPECT_THAT(svg, HasSubstr("CHECK&lt;1&gt;"));
  EXPECT_THAT(svg, Not(HasSubstr("CHECK<1>")));
}

// Oracle: by hand: mean 100; the mean moving range of the baseline is 1, so 3 sigma are 3 / 1.128 =
// 2.66 and D4 is 3.27.
TEST(StatisticsPage, TheLimitsOfAChartAreWrittenBesideTheirLines) {
  const std::string svg = chart_svg(made_chart());
  EXPECT_THAT(svg, HasSubstr("+3\u03c3 102.7"));
  EXPECT_THAT(svg, HasSubstr("mean 100.0"));
  EXPECT_THAT(svg, HasSubstr("\u22123\u03c3 97.3"));
  EXPECT_THAT(svg, HasSubstr("D4 3.3"));
}

// With too few points there are no limits to draw yet.
TEST(StatisticsPage, AChartWithoutABaselineHasNoLimits) {
  CheckUnitChart one;
  one.serial = "CHECK1";
  one.chart = control_chart("zero_offset_mg x", {100, 101}, 10);
  one.times = {*parse_iso8601("2026-01-01"), *parse_iso8601("2026-01-02")};
  const std::string svg = chart_svg(one);
  EXPECT_EQ(count_of(svg, "<circle"), 2U);
  EXPECT_THAT(svg, Not(HasSubstr("\u03c3")));
  EXPECT_THAT(svg, Not(HasSubstr("baseline")));
}

}  // namespace
}  // namespace sixpoint::station
