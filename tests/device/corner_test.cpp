#include "device/corner.h"

#include <set>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::device {
namespace {

TEST(Corner, EachOfTheEightHasItsNameAndItsDirection) {
  std::set<std::string> names;
  for (const Corner& corner : kCorners) {
    const std::string name = to_string(corner);
    names.insert(name);
    const auto back = parse_corner(name);
    ASSERT_OK(back);
    EXPECT_EQ(*back, corner);
    double square = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double force_g = direction_of(corner)[a];
      EXPECT_EQ(force_g > 0 ? '+' : '-', name[2 * a]);
      EXPECT_EQ("xyz"[a], name[2 * a + 1]);
      square += force_g * force_g;
    }
    EXPECT_NEAR(square, 1, 1e-12);
  }
  EXPECT_EQ(names.size(), 8U);
  for (const char* text : {"", "+x", "+x+y", "+y+x+z", "+x+y+z+", "+X+Y+Z", "xyz"}) {
    EXPECT_FAILS(parse_corner(text), ErrorCode::usage);
  }
}

TEST(Corner, TheUnitIsTurnedOverOneEdgeAtATime) {
  for (std::size_t k = 1; k < kCorners.size(); ++k) {
    int turned = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      turned += kCorners[k].signs[a] == kCorners[k - 1].signs[a] ? 0 : 1;
    }
    EXPECT_EQ(turned, 1) << to_string(kCorners[k]);
  }
}

}  // namespace
}  // namespace sixpoint::device
