#include "gap/explain/factors.h"

#include <Eigen/Geometry>

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

const Factor* factor(const std::vector<Factor>& factors, const std::string& name) {
  const auto at =
      std::find_if(factors.begin(), factors.end(), [&](const Factor& f) { return f.name == name; });
  return at == factors.end() ? nullptr : &*at;
}

TEST(Factors, OnlyThoseThatVary) {
  auto blocks = tests::made_dwells();
  EXPECT_NE(factor(factors_of(blocks), "temperature"), nullptr);
  EXPECT_NE(factor(factors_of(blocks), "session"), nullptr);
  EXPECT_EQ(factor(factors_of(blocks), "vibration"), nullptr);
  for (Block& block : blocks) {
    block.temperature_c = 23;
    block.session = 0;
    block.approach_g.setZero();
  }
  const auto factors = factors_of(blocks);
  EXPECT_EQ(factor(factors, "temperature"), nullptr);
  EXPECT_EQ(factor(factors, "the way of the temperature"), nullptr);
  EXPECT_EQ(factor(factors, "session"), nullptr);
  EXPECT_EQ(factor(factors, "side of approach"), nullptr);
  EXPECT_NE(factor(factors, "pose"), nullptr);
}

TEST(Factors, TimeIsCosinesOverTheRecording) {
  const auto factors = factors_of(tests::made_dwells());
  const Factor* time = factor(factors, "time");
  ASSERT_NE(time, nullptr);
  EXPECT_TRUE(time->in_time);
  ASSERT_EQ(time->value.cols(), 4);
  for (Eigen::Index k = 0; k < 4; ++k) {
    EXPECT_NEAR(time->value(0, k), 1, 1e-12);
    EXPECT_NEAR(time->value(17, k), k % 2 == 0 ? -1 : 1, 1e-12);  // cos((k + 1) pi)
    EXPECT_NEAR(time->weight[static_cast<std::size_t>(k)], 1.0 / static_cast<double>(k + 1), 1e-12);
  }
}

// A step of 10 C between the first two dwells, 60 s apart: the lag of 300 s has followed by
// 1 - exp(-0.2).
TEST(Factors, HistoryLagsBehindTheTemperature) {
  auto blocks = tests::made_dwells();
  for (Block& block : blocks) {
    block.temperature_c = &block == &blocks[0] ? 20 : 30;
  }
  const auto factors = factors_of(blocks);
  const Factor* history = factor(factors, "the way of the temperature");
  ASSERT_NE(history, nullptr);
  EXPECT_NEAR(history->value(0, 0), 0, 1e-12);
  EXPECT_NEAR(history->value(1, 0), 2 * std::exp(-0.2), 1e-12);
  EXPECT_NEAR(history->value(2, 0), 2 * std::exp(-0.4), 1e-12);
  EXPECT_NEAR(history->value(2, 1), 2 * std::exp(-120 / 1500.0), 1e-12);
}

// A quarter turn about X, another seat in the same pose, a quarter turn back, and half a turn.
TEST(Factors, TheTurnBeforeIsAnAxis) {
  auto blocks = tests::made_dwells();
  blocks.resize(5);
  const Eigen::Matrix3d quarter =
      Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  blocks[0].rotation.setIdentity();
  blocks[1].rotation = quarter;
  blocks[2].rotation = quarter;
  blocks[3].rotation.setIdentity();
  blocks[4].rotation = quarter * quarter;
  const auto factors = factors_of(blocks);
  const Factor* turn = factor(factors, "the turn before");
  ASSERT_NE(turn, nullptr);
  Eigen::Matrix<double, 5, 3> expected;
  expected << 0, 0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0;
  EXPECT_LT((turn->value - expected).cwiseAbs().maxCoeff(), 1e-12);
  for (Block& block : blocks) {
    block.rotation.setIdentity();
  }
  EXPECT_EQ(factor(factors_of(blocks), "the turn before"), nullptr);
}

TEST(Factors, SessionsAreIndicators) {
  const auto factors = factors_of(tests::made_dwells());
  const Factor* session = factor(factors, "session");
  ASSERT_NE(session, nullptr);
  EXPECT_TRUE(session->value.rowwise().sum().isOnes());
  EXPECT_EQ(session->value(13, 2), 1);
}

}  // namespace
}  // namespace sixpoint::gap
