#include "gap/judge/gap_against.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/judge/diagnose.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

constexpr double kCross = 0.008;

// A force between the axes, in the sensor's frame.
tests::MadeForce crossed_xy(double cross) {
  return [cross](const Segment& segment, double) {
    const Eigen::Vector3d up = segment.rotation.col(2);
    return Eigen::Vector3d(up[0] + cross * up[1], up[1] + cross * up[0], up[2]);
  };
}

// Oracle: the recording itself, made by other lines than the simulator's.
TEST(GapAgainst, WhatTheSimulatorHasIsNoGap) {
  const Bundle recorded = tests::made_production({.seed = 3}, crossed_xy(kCross));
  const auto with = tests::made_production({.seed = 4}, crossed_xy(kCross)).samples;
  const auto without = tests::made_production({.seed = 4}).samples;
  const auto nominal = gap_against(recorded, without, without);
  const auto learnt = gap_against(recorded, with, without);
  const auto half = gap_against(
      recorded, tests::made_production({.seed = 4}, crossed_xy(kCross / 2)).samples, without);
  ASSERT_OK(nominal);
  ASSERT_OK(learnt);
  ASSERT_OK(half);
  EXPECT_GT(nominal->gap_mg, 10 * nominal->floor_mg);
  EXPECT_LT(learnt->gap_mg, 1.5 * learnt->floor_mg);
  EXPECT_NEAR(half->gap_mg, nominal->gap_mg / 2, 0.05 * nominal->gap_mg) << "half is left";
  EXPECT_EQ(nominal->rows, learnt->rows);
}

// Oracle: the diagnosis' own measure of the same recording, which undoes more.
TEST(GapAgainst, WithNothingOnItIsTheDiagnosisGapBefore) {
  const Bundle recorded = tests::made_production({.seed = 3}, crossed_xy(kCross));
  const auto diagnosis = diagnose(recorded);
  const auto nominal = gap_against(recorded, recorded.samples, recorded.samples);
  ASSERT_OK(diagnosis);
  ASSERT_OK(nominal);
  EXPECT_NEAR(nominal->gap_mg, diagnosis->gap.before_mg, 0.02 * nominal->gap_mg);
  EXPECT_NEAR(nominal->floor_mg, diagnosis->gap.floor_mg, 0.05 * nominal->floor_mg);
  EXPECT_NEAR(nominal->unit.gain[0], 1.01, 0.002) << "the unit's own";
  EXPECT_NEAR(nominal->unit.offset_g[1], -0.03, 0.002);
}

TEST(GapAgainst, RefusesAnotherProtocol) {
  const Bundle recorded = tests::made_production({});
  auto fewer = recorded.samples;
  fewer.pop_back();
  EXPECT_FAILS(gap_against(recorded, fewer, recorded.samples), ErrorCode::bad_data);
  EXPECT_FAILS(gap_against(recorded, recorded.samples, fewer), ErrorCode::bad_data);
  EXPECT_FAILS(gap_against(Bundle(), {}, {}), ErrorCode::bad_data);  // no dwell
}

}  // namespace
}  // namespace sixpoint::gap
