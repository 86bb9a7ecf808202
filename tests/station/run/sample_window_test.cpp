#include "station/run/sample_window.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::station {
namespace {

// Oracle: computed by hand. Of 1, 2, 4, 6 the last three have mean 4 and variance 4.
TEST(SampleWindow, HasMeanAndScatterOfTheLastSamples) {
  SampleWindow window(3);
  EXPECT_FALSE(window.add({1, -1, 7}));
  EXPECT_FALSE(window.add({2, -2, 7}));
  EXPECT_TRUE(window.add({4, -4, 7}));
  EXPECT_TRUE(window.add({6, -6, 7}));
  EXPECT_DOUBLE_EQ(window.mean_lsb()[0], 4);
  EXPECT_DOUBLE_EQ(window.mean_lsb()[1], -4);
  EXPECT_DOUBLE_EQ(window.sd_lsb()[0], 2);
  EXPECT_DOUBLE_EQ(window.sd_lsb()[1], 2);
  EXPECT_DOUBLE_EQ(window.sd_lsb()[2], 0);
  EXPECT_EQ(window.repeats(), (PerAxis<int>{0, 0, 3}));
}

TEST(SampleWindow, ClearForgetsSamplesAndKeepsRepeats) {
  SampleWindow window(2);
  window.add({5, 5, 5});
  window.add({5, 6, 5});
  window.clear();
  EXPECT_TRUE(window.empty());
  EXPECT_FALSE(window.add({5, 6, 9}));
  EXPECT_DOUBLE_EQ(window.mean_lsb()[2], 9);
  EXPECT_EQ(window.repeats(), (PerAxis<int>{2, 1, 0}));
}

}  // namespace
}  // namespace sixpoint::station
