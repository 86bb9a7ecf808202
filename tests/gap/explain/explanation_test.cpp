// The best explanation of dwells made by hand, and the questions about it.
#include "gap/explain/explanation.h"

#include <set>

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

EvidenceOptions only(const std::set<std::string>& effects) {
  EvidenceOptions options;
  options.allowed = [effects](const std::string& name) { return effects.count(name) != 0; };
  return options;
}

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

// Leverages of a least-squares fit add up to its number of parameters; the priors of six nuisances
// are wide.
TEST(Explanation, FreedomOfRowsIsRowsLessParameters) {
  const auto blocks = tests::made_dwells({}, 3);
  const Explanation explanation(blocks, only({}));
  double sum = 0;
  for (const double freedom : explanation.row_freedom()) {
    EXPECT_GE(freedom, 0);
    EXPECT_LE(freedom, 1);
    sum += freedom;
  }
  EXPECT_NEAR(sum, 54 - 6, 0.01);
}

// What noise and seating leave: 0.13 mg on every axis, 0.1745 mg on the two horizontal ones.
TEST(Explanation, HeldOutFloorInClosedForm) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({}));
  const Explanation::HeldOut held = explanation.held_out();
  EXPECT_EQ(held.rows, 54);
  EXPECT_NEAR(held.floor_mg, std::sqrt(0.13 * 0.13 + 2.0 / 3 * 0.1745 * 0.1745), 1e-4);
  EXPECT_NEAR(held.before_sigma, 1, 0.35);
  EXPECT_EQ(held.before_mg, held.after_mg) << "nothing is accepted";
  EXPECT_EQ(held.tone_before_sigma, 0) << "no tones";
}

// One group of parameters with prior sd p, measured with sd s: the posterior is s p / hypot(s, p).
TEST(Explanation, UndeterminedIsPosteriorOverPrior) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({"tilt", "third_order"}));
  EXPECT_LT(explanation.undetermined("tilt"), 0.1);
  EXPECT_GT(explanation.undetermined("third_order"), 0.9) << "1 g alone: it looks like a gain";
  EXPECT_GT(explanation.expected_nats("tilt"), kAccept_nats);
  EXPECT_LT(explanation.expected_nats("third_order"), kAccept_nats);
  EXPECT_GT(explanation.expected_nats("truncation"), 1e200) << "not asked for: no smallest size";
}

TEST(Explanation, SeatingOfItsSize) {
  const auto blocks = tests::made_dwells({}, 5, 60, 0.1);
  const Explanation explanation(blocks, {});
  const Fit& fit = explanation.best();
  EXPECT_EQ(fit.scatter, Scatter::seating);
  EXPECT_GT(fit.scatter_size, 0.06);
  EXPECT_LT(fit.scatter_size, 0.16);
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

TEST(ZeroStep, SizeAndEvidence) {
  const Eigen::Vector3d step_mg(8, -4, 5);
  const auto moved = [&](const Block& b) -> Eigen::Vector3d {
    return b.placement >= 9 ? step_mg : Eigen::Vector3d(0, 0, 0);
  };
  const auto blocks = tests::made_dwells(moved, 6);
  const EvidenceModel model(blocks, only({}));
  const ForwardState at = model.first_guess();
  const Whitened data = model.whiten(model.linearise(at), Scatter::nominal, 0);
  const std::optional<Fit> fit = fit_zero_step(model, data, at);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->scatter, Scatter::step);
  EXPECT_NEAR(fit->scatter_size, 8, 0.5);
  EXPECT_GT(fit->nats, model.evidence(data, {}) + 50);
  const std::vector<Block> few(blocks.begin(), blocks.begin() + 2);
  const EvidenceModel short_model(few, only({}));
  EXPECT_FALSE(fit_zero_step(
      short_model, short_model.whiten(short_model.linearise(at), Scatter::nominal, 0), at));
}

TEST(Inconstancies, ConstantParametersHaveNone) {
  for (const unsigned seed : {7U, 8U, 9U}) {
    const auto blocks = tests::made_dwells({}, seed);
    for (const Inconstancy& change : Explanation(blocks, only({})).inconstancies()) {
      EXPECT_LT(change.nats, 5) << change.term << " with " << change.factor;
    }
  }
}

TEST(Inconstancies, AZeroThatFollowsTheSessionIsFound) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return b.session == 1 ? Eigen::Vector3d(2, 1, -2) : Eigen::Vector3d(0, 0, 0);
  });
  const auto found = Explanation(blocks, only({})).inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().factor, "session");
  EXPECT_EQ(found.front().term, "the zero");
  EXPECT_GT(found.front().nats, 50);
}

TEST(Inconstancies, AGainThatFollowsTheTemperatureIsFound) {
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
