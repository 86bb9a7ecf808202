#include "calib/poses/gravity.h"

#include <limits>

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint::calib {
namespace {

// Oracle: NIMA TR8350.2, third edition: normal gravity of WGS84 at the equator, at 45 degrees
// (Moritz 1980 gives 9.80619920 for GRS80; WGS84 differs in the sixth decimal) and at the pole.
TEST(Gravity, PublishedValuesOfTheEllipsoid) {
  EXPECT_NEAR(gravity_at(0, 0)->m_per_s2, 9.7803253359, 1e-9);
  EXPECT_NEAR(gravity_at(45, 0)->m_per_s2, 9.8061992, 5e-6);
  EXPECT_NEAR(gravity_at(90, 0)->m_per_s2, 9.8321849378, 1e-8);
  EXPECT_DOUBLE_EQ(gravity_at(-45, 0)->m_per_s2, gravity_at(45, 0)->m_per_s2);
}

// Oracle: the free-air gradient of geodesy, 0.3086 mGal per metre at 45 degrees, and the reference
// station of Potsdam in the International Gravity Standardization Net 1971: 981260.19 mGal
// (52.3806 N, 87 m).
TEST(Gravity, Height) {
  EXPECT_NEAR(gravity_at(45, 0)->m_per_s2 - gravity_at(45, 1000)->m_per_s2, 3.086e-3, 2e-6);
  const auto potsdam = gravity_at(52.3806, 87);
  ASSERT_OK(potsdam);
  EXPECT_NEAR(potsdam->m_per_s2, 9.8126019, 3 * potsdam->standard_uncertainty_m_per_s2);
}

// The table of gravity.h.
TEST(Gravity, WhatIsGivenSaysWhatItIs) {
  EXPECT_FALSE(local_gravity({}).value()) << "gravity is unknown";
  EXPECT_EQ(local_gravity({9.81, {}, {}}).value()->m_per_s2, 9.81);
  for (const GravityGiven& both :
       {GravityGiven{9.78, 10.0, {}}, GravityGiven{9.81, 90.0, 500}, GravityGiven{9.81, {}, 500}}) {
    const auto refused = local_gravity(both);
    EXPECT_FAILS(refused, ErrorCode::usage);
    EXPECT_THAT(refused.error().hint, testing::HasSubstr("give one"));
  }
  EXPECT_EQ(local_gravity({{}, 48.0, 500}).value()->m_per_s2, gravity_at(48, 500)->m_per_s2);
  EXPECT_EQ(local_gravity({{}, 48.0, {}}).value()->m_per_s2, gravity_at(48, 0)->m_per_s2);
  EXPECT_FAILS(local_gravity({{}, {}, 500}), ErrorCode::usage);
  EXPECT_FAILS(local_gravity({9.0, {}, {}}), ErrorCode::usage);
  EXPECT_FAILS(local_gravity({{}, 91.0, 0}), ErrorCode::usage);
}

TEST(Gravity, Nonsense) {
  EXPECT_FAILS(gravity_at(91, 0), ErrorCode::usage);
  EXPECT_FAILS(gravity_at(std::numeric_limits<double>::quiet_NaN(), 0), ErrorCode::usage);
  EXPECT_FAILS(gravity_at(0, 1e6), ErrorCode::usage);
  EXPECT_FAILS(gravity_entered(1.62), ErrorCode::usage);
  EXPECT_NEAR(gravity_unknown().g(), 1, 1e-12);
  EXPECT_NEAR(gravity_unknown().sd_g(), 0.00153, 1e-5);
}

}  // namespace
}  // namespace sixpoint::calib
