// What an explanation predicts of conditions that it was not fitted to.
#include <Eigen/Cholesky>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// What noise and seating leave: 0.13 mg on every axis, 0.1745 mg on the two horizontal ones.
TEST(EvidenceHeldOut, HeldOutFloorInClosedForm) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({}));
  const Explanation::HeldOut held = explanation.held_out();
  EXPECT_EQ(held.rows, 54);
  EXPECT_NEAR(held.floor_mg, std::sqrt(0.13 * 0.13 + 2.0 / 3 * 0.1745 * 0.1745), 1e-4);
  EXPECT_NEAR(held.before_sigma, 1, 0.35);
  EXPECT_EQ(held.before_mg, held.after_mg) << "nothing is accepted";
  EXPECT_EQ(held.tone_before_sigma, 0) << "no tones";
}

// The values' mean and covariance with the parameters integrated out, scatter nominal.
struct Predicted {
  Eigen::VectorXd off;  // values less their prior mean
  Eigen::MatrixXd covariance;
};

Predicted predicted(const EvidenceModel& model, const Eigen::MatrixXd& linear,
                    const std::vector<int>& groups) {
  Predicted all{linear.col(model.columns()), Eigen::MatrixXd::Zero(model.rows(), model.rows())};
  for (Eigen::Index i = 0; i < model.rows(); i += 3) {
    const Block& block = model.block_of_row(i);
    const Eigen::MatrixXd lever = kNominalSeating_deg * seating_lever(block);
    all.covariance.block<3, 3>(i, i) = block.white_mg2 + lever * lever.transpose();
  }
  for (const int g : with_nuisances(groups)) {
    for (int k = 0; k < model.group(g).count; ++k) {
      const Eigen::VectorXd column = linear.col(model.first_column(g) + k);
      all.covariance += std::pow(model.group(g).sd_of(k), 2) * column * column.transpose();
      all.off -= model.group(g).prior_mean * column;
    }
  }
  return all;
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

Conditional conditional(const EvidenceModel& model, const Predicted& all, int condition) {
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
  const Eigen::Vector3d drift_mg_per_h(9, -6, 7);
  const auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d { return b.middle_s / 3600 * drift_mg_per_h; }, 5,
      120);
  const Explanation explanation(blocks, only({"drift"}));
  ASSERT_TRUE(explanation.best().contains("drift"));
  ASSERT_EQ(explanation.best().scatter, Scatter::nominal);
  const EvidenceModel& model = explanation.model();
  const Eigen::MatrixXd linear = model.linearise(explanation.best().state);
  const Predicted with = predicted(model, linear, model.groups_of("drift"));
  const Predicted without = predicted(model, linear, {});
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
  // In mg the whitened residuals are scaled by each row's own sd: alike but for the seat's
  // correlation of two axes.
  const Explanation::HeldOut held = explanation.held_out();
  EXPECT_NEAR(held.before_mg, std::sqrt(before2_mg2 / 54), 0.05 * held.before_mg);
  EXPECT_NEAR(held.after_mg, std::sqrt(after2_mg2 / 54), 0.05 * held.after_mg);
  EXPECT_GT(held.before_sigma, 2 * held.after_sigma);
  EXPECT_EQ(held.mean_after_sigma, held.after_sigma) << "dwells have means alone";
}

TEST(EvidenceHeldOut, EffectThatIsNotOfTheMeansPredictsNothing) {
  const auto blocks = tests::made_dwells({}, 4);
  EXPECT_EQ(Explanation(blocks, only({})).held_out_nats("clock_error"), 0);
}

}  // namespace
}  // namespace sixpoint::gap
