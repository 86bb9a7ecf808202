#include "repair/rescale/still_windows.h"

#include <gtest/gtest.h>

namespace sixpoint::repair {
namespace {

using gt3x::Counts;

// Two windows of four samples: 1 g, and 250/256 g. What lies between them counts nowhere.
const std::vector<Counts> kTwoRests = {{9, 9, 9},   {256, 0, 0},  {254, 0, 0},  {258, 0, 0},
                                       {256, 0, 0}, {-900, 9, 9}, {0, 0, 250},  {0, 0, 252},
                                       {0, 0, 248}, {0, 0, 250},  {700, 0, 700}};
const std::vector<StillWindow> kWindows = {{1, 4}, {6, 4}};
constexpr double kMean_mg = 0.5 * (0 + 1000.0 * 6 / 256);

TEST(WindowError, IsTheMeanOverTheWindows) {
  WindowError error(kWindows, 256);
  EXPECT_EQ(error.mean_mg(), std::nullopt);
  error.push(kTwoRests);
  ASSERT_TRUE(error.mean_mg());
  EXPECT_NEAR(*error.mean_mg(), kMean_mg, 1e-12);
}

TEST(WindowError, RecordsMayEndAnywhere) {
  for (std::size_t size = 1; size < kTwoRests.size(); ++size) {
    WindowError error(kWindows, 256);
    for (std::size_t begin = 0; begin < kTwoRests.size(); begin += size) {
      error.push(std::span(kTwoRests).subspan(begin, std::min(size, kTwoRests.size() - begin)));
    }
    ASSERT_TRUE(error.mean_mg()) << size;
    EXPECT_NEAR(*error.mean_mg(), kMean_mg, 1e-12) << size;
  }
}

TEST(WindowError, AWindowThatDoesNotEndIsNotJudged) {
  WindowError error(kWindows, 256);
  error.push(std::span(kTwoRests).first(9));
  ASSERT_TRUE(error.mean_mg());
  EXPECT_NEAR(*error.mean_mg(), 0, 1e-12) << "the first window alone";
  EXPECT_EQ(WindowError({}, 256).mean_mg(), std::nullopt);
}

}  // namespace
}  // namespace sixpoint::repair
