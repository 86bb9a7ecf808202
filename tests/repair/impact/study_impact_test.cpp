#include "repair/impact/study_impact.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;

ImpactSummary summary_of_hours(double hours, double enmo_mg, double above) {
  ImpactSummary summary;
  summary.epochs = 720;
  summary.recorded_minutes = 60 * hours;
  summary.enmo_mg = enmo_mg;
  summary.mad_mg = 2 * enmo_mg;
  summary.minutes = {{above, {}, {}}};
  return summary;
}

FileImpact file(const std::string& name, double hours, double before_mg, double after_mg,
                std::optional<double> uncertainty_mg) {
  FileImpact file{"in/" + name,
                  "out/" + name,
                  summary_of_hours(hours, before_mg, 12),
                  summary_of_hours(hours, after_mg, 7),
                  {}};
  file.is.enmo_uncertainty_mg = uncertainty_mg;
  return file;
}

// The table in study_impact.h, a row each.
TEST(StudyImpact, MovesRowNotStated) {
  EXPECT_EQ(moves(file("a", 1, 90, 10, std::nullopt)), std::nullopt);
}
TEST(StudyImpact, MovesRowMoreThanTwice) {
  EXPECT_EQ(moves(file("a", 1, 20, 17.9, 1)), true);
  EXPECT_EQ(moves(file("a", 1, 20, 22.1, 1)), true);
}
TEST(StudyImpact, MovesRowTwiceAtTheMost) {
  EXPECT_EQ(moves(file("a", 1, 20, 18, 1)), false);
  EXPECT_EQ(moves(file("a", 1, 20, 20, 0)), false);
}

StudyImpact three_files() {
  StudyImpact study;
  study.cuts = {{"busy", Measure::enmo_mg, 100}};
  study.files = {file("a.gt3x", 3, 100, 40, 1.5), file("b,c.gt3x", 1, 20, 30, std::nullopt),
                 file("gone.gt3x", 1, 1, 1, 1)};
  study.files[2].error = Error{ErrorCode::bad_data, "damaged", "out/gone.gt3x", "make it again"};
  study.without_copy = 4;
  return study;
}

// By hand: (3 x 100 + 1 x 20) / 4 = 80 before, (3 x 40 + 30) / 4 = 37.5 after.
TEST(StudyImpact, MeansAreWeightedByTime) {
  const auto sum = three_files().summary();
  EXPECT_EQ(sum.files, 2U);
  EXPECT_EQ(sum.failed, 1U);
  EXPECT_DOUBLE_EQ(sum.recorded_minutes, 240);
  EXPECT_DOUBLE_EQ(sum.enmo_before_mg, 80);
  EXPECT_DOUBLE_EQ(sum.enmo_after_mg, 37.5);
  EXPECT_DOUBLE_EQ(sum.mad_after_mg, 75);
  EXPECT_DOUBLE_EQ(sum.minutes_before.at(0), 24);
  EXPECT_DOUBLE_EQ(sum.minutes_after.at(0), 14);
  EXPECT_EQ(sum.moved, 1U);
  EXPECT_EQ(sum.unknown, 1U);
  EXPECT_DOUBLE_EQ(sum.most_mg, -60);
  EXPECT_EQ(sum.most_file, "out/a.gt3x");
}

TEST(StudyImpact, SaysItAsTextJsonAndCsv) {
  const StudyImpact study = three_files();
  EXPECT_TRUE(study.usable());
  EXPECT_THAT(study.brief(), HasSubstr("2 files, 240 minutes: ENMO 80.00 -> 37.50 mg"));
  EXPECT_THAT(study.brief(), HasSubstr("most -60.00 mg (out/a.gt3x)"));
  EXPECT_THAT(study.brief(), HasSubstr("4 more have no repaired copy"));
  const auto json = study.to_json();
  EXPECT_EQ(json["recordings"].size(), 3U);
  EXPECT_EQ(json["recordings"][0]["moves"], true);
  EXPECT_TRUE(json["recordings"][1]["moves"].is_null());
  EXPECT_THAT(json["recordings"][2]["error"].get<std::string>(), HasSubstr("damaged"));
  EXPECT_EQ(json["summary"]["minutes_above"]["busy"]["after"], 14);
  const std::string csv = study_csv(study);
  EXPECT_THAT(csv, HasSubstr("in/a.gt3x,out/a.gt3x,180.000,100.000,40.000,1.500,200.000,80.000,"
                             "12.000,7.000,\n"));
  EXPECT_THAT(csv, HasSubstr("\"in/b,c.gt3x\""));
  std::size_t commas_of_error_line = 0;
  const std::string last = csv.substr(csv.rfind('\n', csv.size() - 2) + 1);
  for (const char c : last) {
    commas_of_error_line += c == ',' ? 1 : 0;
  }
  EXPECT_EQ(commas_of_error_line, 10U) << "as the headline: " << last;
}

TEST(StudyImpact, WithoutFilesThereIsNoAnswer) {
  StudyImpact study;
  study.without_copy = 1;
  EXPECT_FALSE(study.usable());
  EXPECT_TRUE(study.to_json()["summary"]["largest_change_mg"].is_null());
  EXPECT_EQ(study.brief().find("nan"), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::repair
