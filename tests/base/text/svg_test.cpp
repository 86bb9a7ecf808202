#include "base/text/svg.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

TEST(Svg, ScaleMapsItsEndsAndGoesOn) {
  const SvgScale down{-1, 1, 200, 20};
  EXPECT_EQ(down(-1), 200);
  EXPECT_EQ(down(1), 20);
  EXPECT_EQ(down(0), 110);
  EXPECT_EQ(down(2), -70);
}

TEST(Svg, MarksAsText) {
  Svg svg;
  svg.polyline({{0, 1}, {2.25, 3}}, "stroke=\"#000\"");
  svg.text(1, 2, "a<b");
  EXPECT_EQ(svg.marks(),
            "<polyline stroke=\"#000\" points=\"0.0,1.0 2.2,3.0 \"/>"
            "<text x=\"1.0\" y=\"2.0\" >a&lt;b</text>");
}

TEST(Svg, TicksAreRound) {
  EXPECT_EQ(round_ticks(0, 10), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(round_ticks(-0.9, 4.1), (std::vector<double>{0, 1, 2, 3, 4}));
  const std::vector<double> decades = log_ticks(0, 1);
  ASSERT_EQ(decades.size(), 4U);  // 1, 2, 5, 10
  EXPECT_NEAR(decades[2], 0.69897, 1e-5);
  EXPECT_EQ(log_ticks(0, 4).size(), 5U);  // whole decades only
}

}  // namespace
}  // namespace sixpoint
