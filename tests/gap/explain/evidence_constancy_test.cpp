// Parameters that are not constant throughout the recording.
#include <Eigen/Geometry>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

TEST(EvidenceConstancy, ConstantParametersHaveNone) {
  for (const unsigned seed : {7U, 8U, 9U}) {
    const auto blocks = tests::made_dwells({}, seed);
    for (const Inconstancy& change : Explanation(blocks, only({})).inconstancies()) {
      EXPECT_LT(change.nats, 5) << change.term << " with " << change.factor;
    }
  }
}

TEST(EvidenceConstancy, AZeroThatFollowsTheSessionIsFound) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return b.session == 1 ? Eigen::Vector3d(2, 1, -2) : Eigen::Vector3d(0, 0, 0);
  });
  const auto found = Explanation(blocks, only({})).inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().factor, "session");
  EXPECT_EQ(found.front().term, "the zero");
  EXPECT_GT(found.front().nats, 50);
}

// Dwells in a jig with a hinge: each is a quarter turn from the one before, about any axis.
// `seat_rad`: how the unit sits after a turn about this axis.
std::vector<Block> turned_dwells(
    const std::function<Eigen::Vector3d(const Eigen::Vector3d& axis)>& seat_rad) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise_mg(0, tests::kMeanNoise_mg);
  auto blocks = tests::made_dwells();
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    axis[static_cast<Eigen::Index>(random() % 3)] = random() % 2 == 0 ? 1 : -1;
    Block& now = blocks[i];
    now.rotation = Eigen::AngleAxisd(M_PI / 2, axis) * blocks[i - 1].rotation;
    const Eigen::Vector3d up = now.rotation.col(2);
    now.approach_g = up - blocks[i - 1].rotation.col(2);
    now.value_mg = 1000 * (up + seat_rad(axis).cross(up)) +
                   Eigen::Vector3d(noise_mg(random), noise_mg(random), noise_mg(random));
  }
  return blocks;
}

// Each turn stops 0.15 degrees short. As a scatter it looks like seating.
TEST(EvidenceConstancy, ASeatThatFollowsTheTurnBeforeIsFound) {
  constexpr double kShort_rad = 0.15 * M_PI / 180;
  const auto blocks =
      turned_dwells([](const Eigen::Vector3d& axis) { return (-kShort_rad * axis).eval(); });
  const auto found = Explanation(blocks, only({"seating"})).inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().factor, "the turn before");
  EXPECT_EQ(found.front().term, "the seat");
  EXPECT_GT(found.front().nats, 10);
  // Seating of that size has none.
  std::mt19937_64 random(4);
  std::normal_distribution<double> seat_rad(0, kShort_rad);
  const auto seated = turned_dwells([&](const Eigen::Vector3d&) {
    return Eigen::Vector3d(seat_rad(random), seat_rad(random), seat_rad(random));
  });
  for (const Inconstancy& change : Explanation(seated, only({"seating"})).inconstancies()) {
    EXPECT_LT(change.nats, 3) << change.term << " with " << change.factor;
  }
}

TEST(EvidenceConstancy, AGainThatFollowsTheTemperatureIsFound) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return 0.3 * (b.temperature_c - 25) * b.rotation.col(2);
  });
  const Explanation explanation(blocks, only({}));
  const auto found = explanation.inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_NE(found.front().factor.find("temperature"), std::string::npos);
  EXPECT_EQ(found.front().term, "the gain");
}

}  // namespace
}  // namespace sixpoint::gap
