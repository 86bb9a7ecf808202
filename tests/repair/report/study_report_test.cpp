#include "repair/report/study_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/rescale/constants_finder.h"
#include "repair/units/unit_files.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;
using testing::Not;

RepairReport bad_file(const std::string& input, double before_mg) {
  RepairReport report;
  report.input = input;
  report.serial = "MOS2A45130450";
  report.verdict = "affected";
  report.status = RepairStatus::not_repairable;
  report.still_error_before_mg = before_mg;
  report.clipped_before = 7;
  report.clipped_after = 3;
  report.reasons = {"a reason that is said"};
  return report;
}

std::string page_of(StudyReport& study) { return study.html({"A <study>", "2026", "sixpoint"}); }

TEST(StudyReport, TheWorstFilesComeFirst) {
  StudyReport study;
  study.add(bad_file("mild.gt3x", 70));
  study.add(bad_file("worst.gt3x", 210));
  study.add(bad_file("medium.gt3x", 120));
  const std::string page = page_of(study);
  const auto files = page.find("the worst first");
  const auto worst = page.find("worst.gt3x", files);
  const auto medium = page.find("medium.gt3x", files);
  EXPECT_LT(worst, medium);
  EXPECT_LT(medium, page.find("mild.gt3x", files));
  EXPECT_THAT(page, HasSubstr("7 / 3"));
  EXPECT_THAT(page, HasSubstr("a reason that is said"));
}

TEST(StudyReport, NothingIsLoadedAndNothingIsRun) {
  StudyReport study;
  study.add(bad_file("<script>alert(1)</script>\x1b.gt3x", 100));
  const std::string page = page_of(study);
  for (const char* word : {"<script", "http://", "https://", "<link", "<img", "url(", "\x1b"}) {
    EXPECT_THAT(page, Not(HasSubstr(word)));
  }
  EXPECT_THAT(page, HasSubstr("A &lt;study&gt;"));
  EXPECT_THAT(page, HasSubstr("@media print"));
}

TEST(StudyReport, LongListsSayWhatTheyLeaveOut) {
  StudyLimits limits;
  limits.files = 2;
  limits.not_done = 1;
  StudyReport study(limits);
  for (int i = 0; i < 5; ++i) {
    study.add(bad_file(std::to_string(i) + ".gt3x", 100 + i));
  }
  const std::string page = page_of(study);
  EXPECT_THAT(page, HasSubstr("and 3 more"));
  EXPECT_THAT(page, HasSubstr("and 4 more"));
}

TEST(StudyReport, AnEmptyStudyIsAPage) {
  StudyReport study;
  EXPECT_THAT(page_of(study), testing::AllOf(HasSubstr("<td>files</td><td>0</td>"),
                                             HasSubstr("Nothing is left over")));
}

TEST(StudyReport, ThumbnailsShowBothRecordings) {
  MemoryEnv memory;
  ASSERT_OK(tests::many_sides().write(memory.files, "in.gt3x"));
  ConstantsFinder finder(memory.env, {});
  const RepairReport report = repair_file(memory.env, "in.gt3x", "out/in.gt3x", finder, {});
  ASSERT_EQ(report.status, RepairStatus::repaired);
  StudyReport study;
  study.add(report);
  EXPECT_THAT(page_of(study), Not(HasSubstr("<figure>")));
  study.add_thumbnails(memory.files);
  const std::string page = page_of(study);
  EXPECT_THAT(page, HasSubstr("<figure>"));
  EXPECT_THAT(page, HasSubstr(report.source->brief().substr(0, 10)));
  std::size_t curves = 0;
  for (auto at = page.find("<polyline"); at != std::string::npos;
       at = page.find("<polyline", at + 1)) {
    ++curves;
  }
  EXPECT_EQ(curves, 2U);
}

}  // namespace
}  // namespace sixpoint::repair
