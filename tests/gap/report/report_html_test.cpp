#include "gap/report/report_html.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gap/report/made_diagnosis.h"

namespace sixpoint::gap {
namespace {

using ::testing::HasSubstr;
using tests::diagnosed_as;

TEST(ReportHtml, OnePageWithTheSentenceAndNothingFromOutside) {
  const std::string page = report_html(diagnosed_as("<script>alert(1)</script>"));
  EXPECT_NE(page.find("no gap"), std::string::npos);
  EXPECT_NE(page.find("<svg"), std::string::npos);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos) << "the page must need nothing else";
}

// Ten sigma are 1 of 2.5 decades of colour; bars go by the root: a quarter of the gap is half as
// long. By hand.
TEST(ReportHtml, TablesHoldTheNumbersOfTheDiagnosis) {
  Diagnosis d;
  d.gap.before_mg = 4;
  d.gap.after_mg = 1;
  d.gap.floor_mg = 1;
  EffectFinding tilt;
  tilt.name = "tilt";
  tilt.probability = 0.9876;
  tilt.nats = 20;
  tilt.outside_datasheet = true;
  tilt.parameters = {{"rotation_vector_deg", {0.25, -0.5, 0}, {0.01, 0.02, NAN}}};
  tilt.confounded_with = {"misalignment", "seating"};
  d.effects = {tilt};
  d.where = {{1, "a<b", "pose", 2.345, 10}};
  d.not_observable = {{"wrap", "shaker_full_scale"}};
  d.next_segments = {{"shaker", 3, 1.25, {"soft_mount", "bandwidth"}}};
  d.losses = {"no <host> clock"};
  const std::string page = report_html(d);
  EXPECT_THAT(page, HasSubstr("tilt (outside the datasheet)</td><td>0.988</td><td>20.0</td>"));
  EXPECT_THAT(page, HasSubstr("rotation_vector_deg = 0.25, -0.5, 0 &plusmn; 0.01, 0.02, -; "));
  EXPECT_THAT(page, HasSubstr("<td>misalignment, seating</td>"));
  EXPECT_THAT(page, HasSubstr("<td>Y</td><td>a&lt;b</td><td>pose</td><td>2.35</td>"));
  EXPECT_THAT(page, HasSubstr("rgba(181,68,46,0.40)\">10.0<"));
  EXPECT_THAT(page, HasSubstr("<td>before</td><td>4.00 mg</td><td><div class=\"bar\" "
                              "style=\"width:100.0%\">"));
  EXPECT_THAT(page, HasSubstr("<td>with tilt</td><td>1.00 mg</td><td><div class=\"bar\" "
                              "style=\"width:50.0%\">"));
  EXPECT_THAT(page, HasSubstr("<td>floor of noise and seating</td><td>1.00 mg</td>"));
  EXPECT_THAT(page, HasSubstr("<td>wrap</td><td>shaker_full_scale</td>"));
  EXPECT_THAT(page, HasSubstr("Next: shaker (3 minutes, 1.25 nats expected) separates "
                              "soft_mount, bandwidth"));
  EXPECT_THAT(page, HasSubstr("Note: no &lt;host&gt; clock"));
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

TEST(ReportHtml, TwentyEffectsAndTwelveCandidatesAtMost) {
  Diagnosis d;
  EffectFinding finding;
  finding.name = "accepted";
  d.effects.assign(30, finding);
  finding.name = "candidate";
  d.candidates.assign(30, finding);
  const std::string page = report_html(d);
  EXPECT_EQ(count_of(page, "<td>accepted</td>"), 20U);
  EXPECT_EQ(count_of(page, "<td>candidate</td>"), 12U);
  EXPECT_EQ(count_of(page, "<figure"), 6U);  // chart.h lists six drawings
}

}  // namespace
}  // namespace sixpoint::gap
