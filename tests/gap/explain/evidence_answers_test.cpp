// What can be asked about the best explanation.
#include <Eigen/LU>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"
#include "gap/explain/made_marginal.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// Leverages of a least-squares fit add up to its number of parameters; the priors of six nuisances
// are wide.
TEST(EvidenceAnswers, FreedomOfRowsIsRowsLessParameters) {
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

// One group of parameters with prior sd p, measured with sd s: the posterior is s p / hypot(s, p).
TEST(EvidenceAnswers, UndeterminedIsPosteriorOverPrior) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({"tilt", "third_order"}));
  EXPECT_LT(explanation.undetermined("tilt"), 0.1);
  EXPECT_GT(explanation.undetermined("third_order"), 0.9) << "1 g alone: it looks like a gain";
  EXPECT_GT(explanation.expected_nats("tilt"), kAccept_nats);
  EXPECT_LT(explanation.expected_nats("third_order"), kAccept_nats);
  EXPECT_GT(explanation.expected_nats("truncation"), 1e200) << "not asked for: no smallest size";
}

// Generalised least squares with the whole covariance of the values: (X' V^-1 X + P^-1)^-1, P of
// the priors.
TEST(EvidenceAnswers, EstimateHasTheUncertaintyOfLeastSquares) {
  const Eigen::Vector3d drift_mg_per_h(9, -6, 7);
  const auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d { return b.middle_s / 3600 * drift_mg_per_h; }, 5,
      120);
  const Explanation explanation(blocks, only({"drift"}));
  const EvidenceModel& model = explanation.model();
  const int drift = model.groups_of("drift").front();
  const Eigen::MatrixXd linear = model.linearise(explanation.best().state);
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(model.rows(), model.rows());
  for (Eigen::Index i = 0; i < model.rows(); i += 3) {
    const Eigen::MatrixXd lever = kNominalSeating_deg * seating_lever(model.block_of_row(i));
    v.block<3, 3>(i, i) = model.block_of_row(i).white_mg2 + lever * lever.transpose();
  }
  const Eigen::MatrixXd x = linear.leftCols(9);  // gain, offset, drift, and no ripple (no times)
  ASSERT_EQ(model.first_column(drift), 6);
  Eigen::MatrixXd information = x.transpose() * v.inverse() * x;
  for (int i = 0; i < 9; ++i) {
    const ParameterGroup& own = i < 6 ? model.group(i / 3) : explanation.best().groups.front();
    information(i, i) += 1 / std::pow(own.prior_sd, 2);
  }
  const Eigen::MatrixXd covariance = information.inverse();
  const auto estimate = explanation.estimate("drift");
  ASSERT_TRUE(estimate);
  ASSERT_EQ(estimate->value.size(), 3U);
  for (Eigen::Index a = 0; a < 3; ++a) {
    const auto axis = static_cast<std::size_t>(a);
    const double sd = std::sqrt(covariance(6 + a, 6 + a));
    EXPECT_NEAR(estimate->sd[axis], sd, 1e-3 * sd);
    EXPECT_NEAR(estimate->value[axis], drift_mg_per_h[a], 4 * sd);
  }
}

// One effect allowed, scatter nominal: what is tried are the subsets with and without it. Their
// evidence has a closed form (evidence_subsets_test.cpp), about one state each.
TEST(EvidenceAnswers, GainIsTheEvidenceOverTheBestWithout) {
  const auto blocks = tests::made_dwells(
      [](const Block& b) -> Eigen::Vector3d {
        return b.middle_s / 3600 * Eigen::Vector3d(9, -6, 7);
      },
      5, 120);
  const Explanation explanation(blocks, only({"drift"}));
  const EvidenceModel& model = explanation.model();
  const std::vector<int> drift = explanation.best().subset.groups;
  const Whitened data =
      model.whiten(model.linearise(explanation.best().state), Scatter::nominal, 0);
  const double with = model.evidence(data, drift) + model.log_prior(drift);
  EXPECT_NEAR(explanation.best().nats, with, 0.1);
  // The best without it is one with scatter: no better than the evidence without scatter allows.
  EXPECT_GT(explanation.gain_nats("drift"), 10);
  EXPECT_LE(explanation.gain_nats("drift", true), with - model.evidence(data, {}) + 0.5);
  EXPECT_EQ(explanation.gain_nats("clock_error"), 0) << "never tried";
  EXPECT_EQ(explanation.stand_in_nats("drift", "clock_error"), kExcluded_nats);
}

// With two effects allowed that are not there together: the evidence of the one over the other, by
// the covariance of the values.
TEST(EvidenceAnswers, WhatCouldStandInForAnEffectIsJudgedWithoutIt) {
  const auto blocks = tests::made_dwells(
      [](const Block& b) -> Eigen::Vector3d {
        return b.middle_s / 3600 * Eigen::Vector3d(3, -2, 2.5);
      },
      5, 20);
  const Explanation explanation(blocks, only({"drift", "warm_up"}));
  ASSERT_EQ(explanation.best().scatter, Scatter::nominal);
  const double warm_up = explanation.stand_in_nats("drift", "warm_up");
  EXPECT_LT(warm_up, 0);
  EXPECT_GT(explanation.stand_in_nats("warm_up", "drift"), 0);
  const EvidenceModel& model = explanation.model();
  const Eigen::MatrixXd linear = model.linearise(explanation.best().state);
  const auto best_of = [&](const std::string& effect) {
    double best = kNoEvidence_nats;
    for (const int g : model.groups_of(effect)) {
      best = std::max(best, tests::marginal(model, linear, {g}).nats() + model.log_prior({g}));
    }
    return best;
  };
  EXPECT_NEAR(warm_up, best_of("warm_up") - best_of("drift"), 0.1);
}

// A gain that grows by 0.03 %: the log Bayes factor of three more regressors, each axis' gain times
// the time from -1 to 1, of prior size a thousandth (the header's convention), from the covariance
// of the values.
TEST(EvidenceAnswers, ChangeOfTheGainIsABayesFactor) {
  const auto blocks = tests::made_dwells(
      [](const Block& b) -> Eigen::Vector3d {
        return 0.3 * (b.middle_s / 1050) * b.rotation.col(2);
      },
      3);
  const Explanation explanation(blocks, only({}));
  ASSERT_EQ(explanation.best().scatter, Scatter::nominal);
  const EvidenceModel& model = explanation.model();
  const Eigen::MatrixXd linear = model.linearise(explanation.best().state);
  const tests::Marginal constant = tests::marginal(model, linear, {});
  tests::Marginal changing = constant;
  const double first_s = blocks.front().middle_s;
  const double half_s = (blocks.back().middle_s - first_s) / 2;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd column = linear.col(axis);
    for (Eigen::Index row = 0; row < column.size(); ++row) {
      column[row] *= (model.block_of_row(row).middle_s - first_s) / half_s - 1;
    }
    changing.covariance += 1e-3 * 1e-3 * column * column.transpose();
  }
  const double nats = changing.nats() - constant.nats();
  EXPECT_NEAR(explanation.changing_nats("gain"), nats, 1e-3 + 1e-3 * std::abs(nats));
  EXPECT_EQ(explanation.changing_nats("tilt"), 0) << "not in the explanation";
}

// Drifts of the size that is said to show half of the time do so in about half of the recordings.
TEST(EvidenceAnswers, BoundShowsHalfOfTheTime) {
  const auto still = tests::made_dwells({}, 1, 120);
  const std::optional<double> bound = Explanation(still, only({"drift"})).bound("drift");
  ASSERT_TRUE(bound);
  EXPECT_FALSE(Explanation(still, only({"drift"})).bound("clock_error"));
  const auto shown = [&](double size) {
    int count = 0;
    for (unsigned seed = 1; seed <= 30; ++seed) {
      const double u = (seed % 11) / 5.0 - 1;
      const double v = (seed % 7) / 3.0 - 1;
      const auto blocks = tests::made_dwells(
          [&](const Block& b) -> Eigen::Vector3d {
            return b.middle_s / 3600 * size * Eigen::Vector3d(1, u, v);
          },
          seed, 120);
      count += Explanation(blocks, only({"drift"})).gain_nats("drift") > kAccept_nats ? 1 : 0;
    }
    return count;
  };
  EXPECT_GT(shown(*bound), 6);
  EXPECT_LT(shown(*bound), 25);
  EXPECT_GT(shown(2.5 * *bound), 25);
  EXPECT_LT(shown(0.3 * *bound), 4);
}

// A misalignment of a fortieth of a typical one, three standard deviations in each number: that
// its size could have been any up to the typical one counts little against it.
TEST(EvidenceAnswers, ASizeFarBelowTheTypicalIsShown) {
  const auto still = tests::made_dwells();
  const EvidenceModel model(still, only({"misalignment"}));
  Posterior known;
  model.evidence(model.whiten(model.linearise(model.first_guess()), Scatter::nominal, 0),
                 {model.groups_of("misalignment").front()}, &known);
  ForwardState unit;
  unit.misalignment_deg =
      3 * known.covariance.diagonal().segment<3>(kNuisanceParameters).cwiseSqrt();
  int count = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const auto blocks = tests::made_dwells(
        [&](const Block& b) -> Eigen::Vector3d {
          return (predict(unit, b, 1) - predict({}, b, 1)).head<3>();
        },
        seed);
    const Explanation explanation(blocks, only({"misalignment"}));
    count += explanation.gain_nats("misalignment") > kAccept_nats ? 1 : 0;
  }
  EXPECT_GE(count, 15);
}

// The same of a bad seat, and of 1/f noise that the records do not show.
TEST(EvidenceAnswers, BoundOfScatterShowsHalfOfTheTime) {
  const auto nothing = [](double, double) { return 0.0; };
  const auto still = tests::made_dwells();
  const std::optional<double> bound =
      Explanation(still, only({"seating"})).bound(Scatter::seating, nothing);
  ASSERT_TRUE(bound);
  const auto shown = [&](double size_deg) {
    int count = 0;
    for (unsigned seed = 1; seed <= 30; ++seed) {
      const auto blocks =
          tests::made_dwells({}, seed, 60, std::hypot(kNominalSeating_deg, size_deg));
      count += Explanation(blocks, only({"seating"})).gain_nats("seating") > kAccept_nats ? 1 : 0;
    }
    return count;
  };
  EXPECT_GT(shown(*bound), 6);
  EXPECT_LT(shown(*bound), 28);
  EXPECT_GT(shown(2 * *bound), 27);
  EXPECT_LT(shown(0.4 * *bound), 4);
  // Records that show every size leave nothing to the dwells.
  const auto much = [](double, double) { return 1e3; };
  EXPECT_LT(Explanation(still, only({"seating"})).bound(Scatter::flicker, much).value_or(1), 1e-3);
  EXPECT_FALSE(Explanation(still, only({"seating"})).bound(Scatter::flicker, [](double, double) {
    return -1e9;
  }));
}

// By hand: a drift of d over hours h, less what the offset takes over (the mean).
TEST(EvidenceAnswers, GapOfAnEffectIsItsMeanSquareWithoutTheOffset) {
  const Eigen::Vector3d drift(9, -6, 7);
  const auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d { return b.middle_s / 3600 * drift; }, 5, 120);
  const Explanation explanation(blocks, only({"drift"}));
  double h = 0, hh = 0;
  for (const Block& b : blocks) {
    h += b.middle_s / 3600 / 18;
    hh += std::pow(b.middle_s / 3600, 2) / 18;
  }
  const double expected = (hh - h * h) * drift.squaredNorm() / 3;
  const auto found = explanation.gap_mg2();
  ASSERT_EQ(found.count("drift"), 1U);
  // Gains take a little over where early and late dwells do not have the same poses.
  EXPECT_NEAR(found.at("drift"), expected, 0.2 * expected);
}

}  // namespace
}  // namespace sixpoint::gap
