#include "station/statistics/gage_rr.h"

#include <cmath>

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

// AIAG, Measurement Systems Analysis, 4th edition, table III-B 6: ten parts, three appraisers,
// three trials. The figures below were computed a second time, in exact fractions and by other
// formulas, and agree: statistics_oracle.py, which compares the program with them at every run.
constexpr double kAiag[3][3][10] = {
    {{0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36},
     {0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25},
     {0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31}},
    {{0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68},
     {0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62},
     {0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50}},
    {{0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49},
     {-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77},
     {-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16}}};

std::vector<GageReading> aiag() {
  std::vector<GageReading> readings;
  for (std::size_t trial = 0; trial < 3; ++trial) {
    for (std::size_t part = 0; part < 10; ++part) {
      for (std::size_t person = 0; person < 3; ++person) {
        readings.push_back({std::to_string(part + 1),
                            std::string(1, static_cast<char>('A' + person)),
                            kAiag[person][trial][part]});
      }
    }
  }
  return readings;
}

// Oracle: the published analysis of that table (AIAG MSA, tables III-B 7 and 8, and Minitab's
// Gageaiag example): sums of squares 88.3619, 3.1673, 0.3590, 2.7589; F of the interaction 0.434,
// p 0.974; pooled repeatability 0.03997, operator 0.05146, GRR 0.09143, part 1.08645; %GRR 27.86;
// ndc 4.
TEST(GageRr, AiagsExample) {
  const auto report = gage_rr(aiag());
  ASSERT_OK(report);
  ASSERT_EQ(report->anova.size(), 4U);
  EXPECT_NEAR(report->anova[0].sum_of_squares, 88.3619, 5e-5);
  EXPECT_NEAR(report->anova[1].sum_of_squares, 3.1673, 5e-5);
  EXPECT_NEAR(report->anova[2].sum_of_squares, 0.3590, 5e-5);
  EXPECT_NEAR(report->anova[3].sum_of_squares, 2.7589, 5e-5);
  EXPECT_NEAR(*report->anova[0].f, 492.291, 5e-3);
  EXPECT_NEAR(*report->anova[1].f, 79.406, 5e-3);
  EXPECT_NEAR(*report->anova[2].f, 0.434, 5e-4);
  EXPECT_NEAR(*report->anova[2].p, 0.974, 5e-4);
  EXPECT_TRUE(report->pooled);
  EXPECT_NEAR(*report->anova_pooled[0].f, 245.614, 5e-3);
  EXPECT_NEAR(report->repeatability, 0.03997, 5e-6);
  EXPECT_NEAR(report->operator_variance, 0.05146, 5e-6);
  EXPECT_NEAR(report->grr(), 0.09143, 5e-6);
  EXPECT_NEAR(report->part_variance, 1.08645, 5e-6);
  EXPECT_NEAR(report->grr_percent, 27.86, 5e-3);
  EXPECT_EQ(report->ndc, 4);
  EXPECT_EQ(report->judgement(), "not good enough");
  EXPECT_FALSE(report->usable()) << "fewer than five categories";
}

// The rows of the table of the header.
TEST(GageRr, TheJudgementFollowsTheTable) {
  struct Case {
    double percent;
    int categories;
    std::string judgement;
    bool usable;
  };
  for (const Case& each : {Case{9.9, 14, "good", true},
                           {10, 14, "may do, depending on what it is for", true},
                           {27.1, 5, "may do, depending on what it is for", true},
                           {27.86, 4, "not good enough", false},
                           {30, 5, "may do, depending on what it is for", true},
                           {30.1, 5, "not good enough", false},
                           {80, 1, "not good enough", false}}) {
    GageReport report;
    report.grr_percent = each.percent;
    report.ndc = each.categories;
    EXPECT_EQ(report.judgement(), each.judgement) << each.percent;
    EXPECT_EQ(report.usable(), each.usable) << each.percent;
  }
}

// Without pooling the components are those of the full table. Oracle: expected mean squares, by
// hand from the published mean squares (9.81799, 1.58363, 0.01994, 0.04598).
TEST(GageRr, WithoutPooling) {
  GageOptions options;
  options.pool_above_p = 1;
  options.tolerance = 8;
  const auto report = gage_rr(aiag(), options);
  ASSERT_OK(report);
  EXPECT_FALSE(report->pooled);
  EXPECT_NEAR(report->repeatability, 0.04598, 5e-6);
  EXPECT_EQ(report->interaction, 0) << "negative is none";
  EXPECT_NEAR(report->operator_variance, (1.58363 - 0.01994) / 30, 1e-6);
  EXPECT_NEAR(report->part_variance, (9.81799 - 0.01994) / 9, 1e-6);
  EXPECT_NEAR(*report->grr_percent_of_tolerance, 100 * 6 * std::sqrt(report->grr()) / 8, 1e-9);
}

TEST(GageRr, WhatIsNoStudyIsRefused) {
  auto readings = aiag();
  readings.pop_back();
  EXPECT_FAILS(gage_rr(readings), ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({}), ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({{"1", "A", 1}, {"1", "B", 1}, {"2", "A", 1}, {"2", "B", 1}}),
               ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({{"1", "A", 1}, {"1", "B", std::nan("")}}), ErrorCode::bad_data);
  for (const double factor : {1e154, 1e200, 1e307}) {
    std::vector<GageReading> large = aiag();
    for (auto& reading : large) {
      reading.value *= factor;
    }
    const auto refused = gage_rr(large);
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_THAT(refused.error().what, testing::HasSubstr("too large")) << factor;
  }
  std::vector<GageReading> alike = aiag();
  for (auto& reading : alike) {
    reading.value = 1;
  }
  EXPECT_FAILS(gage_rr(alike), ErrorCode::bad_data);
}

TEST(GageRr, RepeatsWithoutAnyScatterAreACopyAndNoStudy) {
  std::vector<GageReading> readings;
  for (int repeat = 0; repeat < 2; ++repeat) {
    for (const auto& [part, value] : {std::pair{"1", 10.1}, {"2", 20.2}, {"3", 30.3}}) {
      readings.push_back({part, "Ada", value});
      readings.push_back({part, "Bo", value + 0.1});
    }
  }
  const auto refused = gage_rr(readings);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  readings.back().value += 0.1;
  EXPECT_OK(gage_rr(readings));
}

TEST(GageCsv, ColumnsInAnyOrder) {
  const auto readings = parse_gage_csv("value,part,operator\r\n1.5,7,Ada\r\n\r\n-2e-1,8,Bo\n", "f");
  ASSERT_OK(readings);
  ASSERT_EQ(readings->size(), 2U);
  EXPECT_EQ((*readings)[1].part, "8");
  EXPECT_EQ((*readings)[1].operator_name, "Bo");
  EXPECT_EQ((*readings)[1].value, -0.2);
  const auto quoted =
      parse_gage_csv("part,operator,value\n\"7, left\",\"Lovelace, Ada\",\"1.5\"", "f");
  ASSERT_OK(quoted);
  EXPECT_EQ((*quoted)[0].part, "7, left");
  EXPECT_EQ((*quoted)[0].operator_name, "Lovelace, Ada");
  EXPECT_EQ((*quoted)[0].value, 1.5);
  for (const char* bad : {"", "part,value\n1,2\n", "part,operator,value\n",
                          "part,operator,value\n1,A\n", "part,operator,value\n1,A,x\n",
                          "part,operator,value\n1,A,nan\n", "part,operator,value\n1,A,1.5mg\n"}) {
    EXPECT_FAILS(parse_gage_csv(bad, "f"), ErrorCode::bad_data);
  }
  EXPECT_EQ(parse_gage_csv("part,operator,value\n1,A,2\n1,A,x\n", "f.csv").error().where,
            "f.csv:3");
}

}  // namespace
}  // namespace sixpoint::station
