#include "calib/application/agreement.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sixpoint::calib {
namespace {

const Calibration kOne = {{0.004, 0.004, 0.004}, {10, 20, 30}};

TEST(AgreementOfConstants, TheSameSetAgreesWithItself) {
  const Agreement same = agreement(kOne, {}, kOne, {});
  EXPECT_NEAR(same.difference_mg, 0, 1e-9);
  EXPECT_TRUE(same.agree());
}

TEST(AgreementOfConstants, AZeroThatMovedIsFoundWithItsAxis) {
  Calibration other = kOne;
  other.zero_lsb[1] += 3;  // 12 mg
  const Agreement between = agreement(kOne, {}, other, {});
  EXPECT_NEAR(between.difference_mg, 12, 1e-9);
  EXPECT_EQ(between.axis, 1U);
  EXPECT_DOUBLE_EQ(between.allowed_mg, kTemperatureAllowance_mg);
  EXPECT_FALSE(between.agree());
  EXPECT_THAT(between.brief(), testing::HasSubstr("12.0 mg on y"));
}

// By hand: 3 sqrt(3^2 + 4^2) + 10 = 25 mg; without the second one 3 * 3 + 10 = 19 mg.
TEST(AgreementOfConstants, BothUncertaintiesCount) {
  Calibration other = kOne;
  other.zero_lsb[2] += 6;  // 24 mg
  const ConstantsUncertainty first = {{}, {3, 3, 3}};
  const ConstantsUncertainty second = {{}, {4, 4, 4}};
  const Agreement between = agreement(kOne, first, other, second);
  EXPECT_NEAR(between.allowed_mg, 25, 1e-9);
  EXPECT_TRUE(between.agree());
  EXPECT_FALSE(agreement(kOne, first, other, {}).agree());
}

TEST(AgreementOfConstants, ASensitivityIsFoundAwayFromZero) {
  Calibration other = kOne;
  other.sensitivity_g_per_lsb[0] *= 1.03;  // 30 mg at 1 g
  const Agreement between = agreement(kOne, {}, other, {});
  EXPECT_NEAR(between.difference_mg, 30, 1e-9);
  EXPECT_EQ(std::abs(between.at_g), 1);
}

TEST(AgreementOfConstants, AnUncertaintyThatIsNotStatedCountsAsNone) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const ConstantsUncertainty unknown = {{none, none, none}, {none, none, none}};
  EXPECT_EQ(standard_uncertainty_mg(unknown, 0, 1), 0);
  EXPECT_EQ(largest_uncertainty_mg(unknown), 0);
  // By hand: sqrt(3^2 + (1000 * 0.004)^2) = 5 mg.
  EXPECT_NEAR(largest_uncertainty_mg({{0.004, 0, 0}, {3, 1, 1}}), 5, 1e-9);
}

}  // namespace
}  // namespace sixpoint::calib
