#include "base/random.h"

#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Random, MomentsOfUniformAndNormal) {
  Random random(7);
  constexpr int kCount = 200'000;
  double sum = 0;
  double sum2 = 0;
  double sum4 = 0;
  double uniform_sum = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
    const double u = random.uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    uniform_sum += u;
  }
  EXPECT_NEAR(sum / kCount, 0, 5 / std::sqrt(kCount));
  EXPECT_NEAR(sum2 / kCount, 1, 5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(sum4 / kCount, 3, 5 * std::sqrt(96.0 / kCount));
  EXPECT_NEAR(uniform_sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
}

TEST(Random, SameSeedSameNumbersOtherStreamOthers) {
  Random a(5, 1);
  Random b(5, 1);
  Random c(5, 2);
  bool differ = false;
  for (int i = 0; i < 100; ++i) {
    const auto bits = a.bits();
    EXPECT_EQ(bits, b.bits());
    differ = differ || bits != c.bits();
    EXPECT_LT(a.below(7), 7U);
    b.below(7);
  }
  EXPECT_TRUE(differ);
}

}  // namespace
}  // namespace sixpoint
