// sixpoint gap report by its contract; tests/gap/adopt has the measure.
#include <filesystem>
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::CommandTest;

TEST_F(CommandTest, TheReportShowsHowTheGapShrank) {
  for (const int seed : {1, 2, 3}) {
    std::ofstream(path("unit.json"))
        << R"({"protocol": "production", "effects": [{"name": "non_orthogonality",
               "parameters": {"yz_xz_xy": [0.008, 0.006, -0.007]}}], "seed": )"
        << seed << "}";
    ASSERT_EQ(run({"simulate", "--scenario", path("unit.json"), "-o",
                   path((seed == 3 ? "new" : "b") + std::to_string(seed))})
                  .exit_code,
              0);
  }
  ASSERT_EQ(run({"gap", "adopt", path("b1"), path("b2"), "-o", path("S.json")}).exit_code, 0);
  const auto answer = run({"gap", "report", path("b1"), path("new3"), "--scenario", path("S.json"),
                           "-o", path("r.html"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/gap-report/1");
  EXPECT_EQ(json["bundles"][0]["learnt_from"], true);
  EXPECT_EQ(json["bundles"][1]["learnt_from"], false);
  // The units are alike: what is left is the noise.
  EXPECT_GT(json["new"]["closed_fraction"], 0.95);
  EXPECT_LT(json["new"]["after_mg"][0], 0.2 * json["new"]["before_mg"].get<double>());
  EXPECT_EQ(json["effects"][0]["name"], "non_orthogonality");
  std::ifstream page(path("r.html"));
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  EXPECT_THAT(text, HasSubstr("adoption 1"));
  EXPECT_THAT(run({"gap", "report", path("new3"), "--scenario", path("S.json")}).out,
              HasSubstr("non_orthogonality    closes"));
}

TEST_F(CommandTest, TheReportRefusesWhatItCannotRead) {
  std::ofstream(path("S.json")) << R"({"protocol": "production"})";
  EXPECT_EQ(run({"gap", "report", "--scenario", path("S.json")}).exit_code, 64);
  EXPECT_EQ(run({"gap", "report", path("none"), "--scenario", path("S.json")}).exit_code, 66);
  EXPECT_EQ(run({"gap", "report", path("S.json"), "--scenario", path("S.json")}).exit_code, 64)
      << "a document holds no samples";
  EXPECT_EQ(run({"gap", "report", path("x"), "--scenario", path("none.json")}).exit_code, 66);
  ASSERT_EQ(run({"simulate", "--scenario", path("S.json"), "-o", path("b")}).exit_code, 0);
  const auto nothing = run({"gap", "report", path("b"), "--scenario", path("S.json")});
  EXPECT_EQ(nothing.exit_code, 2) << "nothing was adopted yet";
  EXPECT_THAT(nothing.out, HasSubstr("learnt nothing"));
}

}  // namespace
}  // namespace sixpoint::cli
