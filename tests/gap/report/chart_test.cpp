#include "gap/report/chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// 0 to 1 on both axes, 6 % of room on either side: x = 64 + 388 (0.06 / 1.12), and
// y = 206 - 190 (0.06 / 1.12) from the bottom.
TEST(Chart, PointsStandWhereTheScaleHasThem) {
  Chart chart("title", "across", "up");
  chart.points({0, 1}, {0, 1}, "#123456", "series");
  const std::string drawing = chart.drawing();
  EXPECT_THAT(drawing, HasSubstr("<circle cx=\"84.8\" cy=\"195.8\" r=\"2\" fill=\"#123456\"/>"));
  EXPECT_THAT(drawing, HasSubstr("<circle cx=\"431.2\" cy=\"26.2\" r=\"2\" fill=\"#123456\"/>"));
  EXPECT_THAT(drawing, HasSubstr(">across</text>"));
  EXPECT_THAT(drawing, HasSubstr(">series</text>"));
  EXPECT_THAT(drawing, HasSubstr(">0.4</text>"));  // ticks of 0.2
  EXPECT_THAT(chart.figure(), HasSubstr("<figcaption>title</figcaption>"));
}

TEST(Chart, LogarithmicAxesNameDecades) {
  Chart chart("title", "s", "mg");
  chart.log_x();
  chart.line({0.1, 1000}, {1, 2}, "#000", "");
  const std::string drawing = chart.drawing();
  EXPECT_THAT(drawing, HasSubstr(">0.1</text>"));
  EXPECT_THAT(drawing, HasSubstr(">1000</text>"));
  EXPECT_THAT(drawing, Not(HasSubstr(">200</text>")));
}

TEST(Chart, NothingToDrawIsSaid) {
  Chart chart("title", "x", "y");
  EXPECT_TRUE(chart.empty());
  EXPECT_THAT(chart.drawing(), HasSubstr("does not show it"));
}

TEST(Report, ShadeIsTheLogarithmOfSigma) {
  EXPECT_EQ(sigma_shade(0.5), 0);
  EXPECT_NEAR(sigma_shade(10), 0.4, 1e-12);
  EXPECT_EQ(sigma_shade(1e6), 1);
}

// 25 to 9 mg^2; three quarters and one quarter of the evidence close 12 and 4 mg^2.
TEST(Report, BarsAddInSquares) {
  Diagnosis diagnosis;
  diagnosis.gap.before_mg = 5;
  diagnosis.gap.after_mg = 3;
  for (const double nats : {30.0, 10.0}) {
    EffectFinding effect;
    effect.name = nats > 20 ? "tilt" : "drift";
    effect.nats = nats;
    diagnosis.effects.push_back(effect);
  }
  const auto bars = gap_bars(diagnosis);
  ASSERT_EQ(bars.size(), 3U);
  EXPECT_EQ(bars[0].second, 5);
  EXPECT_EQ(bars[1].first, "with tilt");
  EXPECT_NEAR(bars[1].second, std::sqrt(13.0), 1e-12);
  EXPECT_NEAR(bars[2].second, 3, 1e-12);
}

}  // namespace
}  // namespace sixpoint::gap
