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

WindowError expecting(const std::vector<StillWindow>& windows) {
  WindowError error(256);
  for (const StillWindow& window : windows) {
    error.expect(window);
  }
  return error;
}

TEST(WindowError, IsTheMeanOverTheWindows) {
  EXPECT_EQ(expecting(kWindows).mean_mg(kWindows), std::nullopt);
  WindowError error = expecting(kWindows);
  error.push(kTwoRests);
  const auto mean_mg = error.mean_mg(kWindows);
  ASSERT_TRUE(mean_mg);
  EXPECT_NEAR(*mean_mg, kMean_mg, 1e-12);
  const std::vector<StillWindow> second = {kWindows[1]};
  EXPECT_NEAR(error.mean_mg(second).value(), 2 * kMean_mg, 1e-12) << "of those that are asked for";
  EXPECT_EQ(error.mean_mg({}), std::nullopt);
}

TEST(WindowError, RecordsMayEndAnywhere) {
  for (std::size_t size = 1; size < kTwoRests.size(); ++size) {
    WindowError error = expecting(kWindows);
    for (std::size_t begin = 0; begin < kTwoRests.size(); begin += size) {
      error.push(std::span(kTwoRests).subspan(begin, std::min(size, kTwoRests.size() - begin)));
    }
    const auto mean_mg = error.mean_mg(kWindows);
    ASSERT_TRUE(mean_mg) << size;
    EXPECT_NEAR(*mean_mg, kMean_mg, 1e-12) << size;
  }
}

TEST(WindowError, AWindowThatDoesNotEndIsNotJudged) {
  WindowError error = expecting(kWindows);
  error.push(std::span(kTwoRests).first(9));
  const auto mean_mg = error.mean_mg(kWindows);
  ASSERT_TRUE(mean_mg);
  EXPECT_NEAR(*mean_mg, 0, 1e-12) << "the first window alone";
}

// A window as long as one may be, told of when its last sample has passed, behind so many samples
// that most of them were judged by then.
TEST(WindowError, AWindowMayBeToldOfWhenItHasPassed) {
  constexpr std::size_t kLongest = WindowError::kLongestWindow;
  for (const std::size_t before : {std::size_t{0}, std::size_t{1}, 2 * kLongest, 5 * kLongest}) {
    const StillWindow window = {before, static_cast<int>(kLongest)};
    WindowError error(256);
    const std::vector<Counts> moving(1000, Counts{900, 900, 900});
    for (std::size_t i = 0; i < before; i += moving.size()) {
      error.push(std::span(moving).first(std::min(moving.size(), before - i)));
    }
    const std::vector<Counts> rest(1024, Counts{0, 0, 250});
    for (std::size_t i = 0; i < kLongest; i += rest.size()) {
      if (i + rest.size() == kLongest) {
        error.expect(window);
      }
      error.push(rest);
    }
    error.push(moving);
    EXPECT_NEAR(error.mean_mg({{window}}).value(), 1000.0 * 6 / 256, 1e-9) << before;
  }
}

TEST(WindowError, EachWindowIsJudgedByItsOwnScale) {
  WindowError error = expecting(kWindows);
  error.push(std::span(kTwoRests).first(6));
  error.set_scale(250);
  error.push(std::span(kTwoRests).subspan(6));
  EXPECT_NEAR(error.mean_mg(kWindows).value(), 0, 1e-12);
}

}  // namespace
}  // namespace sixpoint::repair
