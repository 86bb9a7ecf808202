// What an explanation predicts of conditions that it was not fitted to.
#include <Eigen/Cholesky>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"
#include "gap/explain/made_marginal.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// What noise and seating leave: 0.13 mg on every axis, 0.1745 mg on the two horizontal ones.
TEST(EvidenceHeldOut, HeldOutFloorInClosedForm) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({}));
  const Explanation::HeldOut held = explanation.held_out({});
  EXPECT_EQ(held.rows, 54);
  EXPECT_NEAR(held.floor_mg, std::sqrt(0.13 * 0.13 + 2.0 / 3 * 0.1745 * 0.1745), 1e-4);
  EXPECT_NEAR(held.before_sigma, 1, 0.35);
  EXPECT_EQ(held.before_mg, held.after_mg) << "nothing is accepted";
  EXPECT_EQ(held.tone_before_sigma, 0) << "no tones";
}

std::vector<Block> drifting_dwells() {
  const Eigen::Vector3d drift_mg_per_h(9, -6, 7);
  return tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d { return b.middle_s / 3600 * drift_mg_per_h; }, 5,
      120);
}

// What is found and not named is not fitted: it would leave its share in gains and offsets.
TEST(EvidenceHeldOut, OnlyWhatIsNamedIsFitted) {
  const auto blocks = drifting_dwells();
  const Explanation explanation(blocks, only({"drift"}));
  ASSERT_TRUE(explanation.best().contains("drift"));
  const Explanation::HeldOut held = explanation.held_out({});
  EXPECT_NEAR(held.after_mg, held.before_mg, 1e-9);
  EXPECT_LT(explanation.held_out({"drift"}).after_mg, held.before_mg / 2);
}

// Rows of one condition, given all others: a conditional Gaussian.
struct Conditional {
  Eigen::VectorXd residual;
  Eigen::MatrixXd covariance;
  double nats() const {
    const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
    return -0.5 * residual.dot(llt.solve(residual)) - half_log_determinant(llt);
  }
};

Conditional conditional(const EvidenceModel& model, const tests::Marginal& all, int condition) {
  std::vector<Eigen::Index> own, others;
  for (Eigen::Index row = 0; row < model.rows(); ++row) {
    (model.block_of_row(row).condition == condition ? own : others).push_back(row);
  }
  const Eigen::LDLT<Eigen::MatrixXd> seen(all.covariance(others, others));
  const Eigen::MatrixXd cross = all.covariance(own, others);
  return {all.off(own) - cross * seen.solve(Eigen::VectorXd(all.off(others))),
          all.covariance(own, own) - cross * seen.solve(cross.transpose())};
}

// The same by way of the covariance of the values instead of the normal equations of the
// parameters: each condition's log likelihood given all others, with and without the effect.
TEST(EvidenceHeldOut, PredictsEachConditionFromTheOthers) {
  const auto blocks = drifting_dwells();
  const Explanation explanation(blocks, only({"drift"}));
  ASSERT_TRUE(explanation.best().contains("drift"));
  ASSERT_EQ(explanation.best().scatter, Scatter::nominal);
  const EvidenceModel& model = explanation.model();
  const Eigen::MatrixXd linear = model.linearise(explanation.best().state);
  const tests::Marginal with = tests::marginal(model, linear, explanation.best().subset.groups);
  const tests::Marginal without = tests::marginal(model, linear, {});
  double nats = 0;
  double before2_mg2 = 0;
  double after2_mg2 = 0;
  for (int condition = 0; condition < 8; ++condition) {
    const Conditional after = conditional(model, with, condition);
    const Conditional before = conditional(model, without, condition);
    if (after.residual.size() > 0) {
      nats += after.nats() - before.nats();
      before2_mg2 += before.residual.squaredNorm();
      after2_mg2 += after.residual.squaredNorm();
    }
  }
  EXPECT_GT(nats, 20);
  EXPECT_NEAR(explanation.held_out_nats("drift"), nats, 1e-3 * nats);
  // Each face is up along an axis: rows are independent, and whitening is a division by their sd.
  const Explanation::HeldOut held = explanation.held_out({"drift"});
  EXPECT_NEAR(held.before_mg, std::sqrt(before2_mg2 / 54), 1e-3 * held.before_mg);
  EXPECT_NEAR(held.after_mg, std::sqrt(after2_mg2 / 54), 1e-3 * held.after_mg);
  EXPECT_GT(held.before_sigma, 2 * held.after_sigma);
  EXPECT_EQ(held.mean_after_sigma, held.after_sigma) << "dwells have means alone";
  // What is not named closes nothing.
  EXPECT_GT(explanation.held_out({}).after_mg, 2 * held.after_mg);
}

TEST(EvidenceHeldOut, EffectThatIsNotOfTheMeansPredictsNothing) {
  const auto blocks = tests::made_dwells({}, 4);
  EXPECT_EQ(Explanation(blocks, only({})).held_out_nats("clock_error"), 0);
}

}  // namespace
}  // namespace sixpoint::gap
