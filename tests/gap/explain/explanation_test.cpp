// The best explanation of dwells made by hand, and the questions about it.
#include "gap/explain/explanation.h"

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// The header's example.
TEST(Explanation, NamesAndMeasuresATilt) {
  const Eigen::Vector2d tilt_deg(0.2, -0.15);
  const auto blocks = tests::made_dwells([&](const Block& b) -> Eigen::Vector3d {
    const Eigen::Vector3d turn = Eigen::Vector3d(tilt_deg[0], tilt_deg[1], 0) * M_PI / 180;
    return 1000 * b.rotation * turn.cross(Eigen::Vector3d::UnitZ());
  });
  const Explanation explanation(blocks, {});
  ASSERT_TRUE(explanation.best().contains("tilt"));
  EXPECT_EQ(explanation.best().scatter, Scatter::nominal);
  EXPECT_GT(explanation.gain_nats("tilt"), 20);
  EXPECT_GT(explanation.held_out_nats("tilt"), 20);
  const auto estimate = explanation.estimate("tilt");
  ASSERT_TRUE(estimate);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(estimate->value[i], tilt_deg[static_cast<Eigen::Index>(i)],
                4 * estimate->sd[i] + 0.001);
  }
  EXPECT_LT(explanation.nominal().nats, explanation.best().nats);
}

TEST(Explanation, NothingMissing) {
  const auto blocks = tests::made_dwells({}, 3);
  const Explanation explanation(blocks, {});
  EXPECT_TRUE(explanation.best().groups.empty());
  EXPECT_FALSE(explanation.unknown_wins());
  EXPECT_LT(explanation.gain_nats("drift"), 0);
  EXPECT_LT(explanation.changing_nats("gain"), 1);
  EXPECT_FALSE(explanation.estimate("clock_error")) << "no effect of the means";
  EXPECT_EQ(explanation.undetermined("clock_error"), 1);
}

TEST(Explanation, SeatingOfItsSize) {
  const auto blocks = tests::made_dwells({}, 5, 60, 0.1);
  const Explanation explanation(blocks, {});
  const Fit& fit = explanation.best();
  EXPECT_EQ(fit.scatter, Scatter::seating);
  EXPECT_GT(fit.scatter_size, 0.06);
  EXPECT_LT(fit.scatter_size, 0.16);
}

// Seats of 0.15 degrees and a walk of 0.2 mg in the root of a second: each of its size, where one
// alone would have to be larger. What the records say of the walk is left out.
TEST(Explanation, BadSeatsBesideAWalk) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::Vector3d walk_mg = Eigen::Vector3d::Zero();
  constexpr double kEvery_s = 60;
  const auto blocks = tests::made_dwells(
      [&](const Block&) -> Eigen::Vector3d {
        walk_mg += 0.2 * std::sqrt(kEvery_s) *
                   Eigen::Vector3d(normal(random), normal(random), normal(random));
        return walk_mg;
      },
      5, kEvery_s, 0.15);
  const Explanation explanation(blocks, only({"seating", "random_walk"}));
  const Fit& fit = explanation.best();
  EXPECT_EQ(fit.scatter, Scatter::random_walk);
  EXPECT_GT(fit.size_of(Scatter::random_walk), 0.13);
  EXPECT_LT(fit.size_of(Scatter::random_walk), 0.3);
  EXPECT_GT(fit.size_of(Scatter::seating), 0.1);
  EXPECT_LT(fit.size_of(Scatter::seating), 0.22);
  EXPECT_EQ(fit.size_of(Scatter::flicker), 0);
  EXPECT_GT(explanation.gain_nats("seating"), 3);
  EXPECT_GT(explanation.gain_nats("random_walk"), 3);
  const auto gap_mg2 = explanation.gap_mg2();
  EXPECT_GT(gap_mg2.at("seating"), 1);
  EXPECT_GT(gap_mg2.at("random_walk"), 1);
  // Either alone takes the other one for itself.
  EXPECT_EQ(Explanation(blocks, only({"random_walk"})).best().size_of(Scatter::seating), 0);
}

// Each seat begins where the one before was. Seats of the same size that are new each time are
// `seating` (above).
TEST(Explanation, ASeatThatWalksIsUnknown) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  Eigen::Vector3d seat_rad = Eigen::Vector3d::Zero();
  const auto blocks = tests::made_dwells([&](const Block& b) -> Eigen::Vector3d {
    constexpr double kStep_rad = 0.04 * M_PI / 180;
    seat_rad += kStep_rad * Eigen::Vector3d(normal(random), normal(random), normal(random));
    return seat_rad.cross(1000 * b.rotation.col(2));
  });
  const Explanation explanation(blocks, {});
  EXPECT_TRUE(explanation.unknown_wins());
  EXPECT_EQ(explanation.best().scatter, Scatter::seat_walks);
  EXPECT_GT(explanation.unknown_nats(), kUnknownWins_nats);
}

TEST(Explanation, ScatterThatIsNoRotationIsUnknown) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return 5 * std::sin(11.0 * b.placement) * b.rotation.col(2);  // along gravity
  });
  const Explanation explanation(blocks, only({"seating"}));
  EXPECT_TRUE(explanation.unknown_wins());
  EXPECT_FALSE(in_catalogue(explanation.best().scatter));
  EXPECT_GT(explanation.unknown_nats(), kUnknownWins_nats);
}

}  // namespace
}  // namespace sixpoint::gap
