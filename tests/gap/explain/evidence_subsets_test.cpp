// Evidence, priors and search against closed forms.
#include <gtest/gtest.h>

#include "gap/explain/evidence.h"
#include "gap/explain/made_blocks.h"
#include "gap/explain/made_marginal.h"

namespace sixpoint::gap {
namespace {

TEST(EvidenceSubsets, EvidenceIsTheMarginalLikelihood) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  const Eigen::MatrixXd linear = model.linearise(model.first_guess());
  const Whitened data = model.whiten(linear, Scatter::nominal, 0);
  const int tilt = model.groups_of("tilt").front();
  const int drift = model.groups_of("drift").front();
  for (const std::vector<int>& groups :
       {std::vector<int>{}, std::vector<int>{tilt}, std::vector<int>{tilt, drift}}) {
    EXPECT_NEAR(model.evidence(data, groups), tests::marginal(model, linear, groups).nats(), 1e-3);
  }
}

// The table of log_prior_of_count().
TEST(EvidenceSubsets, ThePriorOfManyEffectsIsThatOfAUnitWithALittleOfEverything) {
  for (const auto& [count, nats] : {std::pair<std::size_t, double>{0, 0},
                                    {1, -3.5},
                                    {2, -7.0},
                                    {3, -10.4},
                                    {4, -12.5},
                                    {10, -12.8}}) {
    EXPECT_NEAR(log_prior_of_count(count), nats, 0.05) << count;
  }
}

// Ten small effects at once, each a fifth of its typical size and more: what the pairs of the
// search alone would not find.
TEST(EvidenceSubsets, ClimbingFindsManySmallEffects) {
  const auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d {
        const Eigen::Vector3d up = b.rotation.col(2);
        const Eigen::Vector3d turned = Eigen::Vector3d(0.2, -0.15, 0.1) * M_PI / 180;
        const Eigen::Vector3d cross(4 * up[1] - 3 * up[2], 4 * up[0] + 2 * up[2],
                                    -3 * up[0] + 2 * up[1]);
        const Eigen::Vector3d step = b.approach_g.array().sign().matrix();
        return 1000 * turned.cross(up) + cross +
               (b.temperature_c - kReference_c) * Eigen::Vector3d(0.3, -0.2, 0.25) +
               b.middle_s / 3600 * Eigen::Vector3d(1.5, 2, -1.5) +
               0.8 * Eigen::Vector3d(1, -1, 1).cwiseProduct(step);
      },
      3, 300);
  EvidenceOptions options = tests::only({"misalignment", "non_orthogonality", "offset_tempco",
                                         "drift", "hysteresis", "second_order", "warm_up"});
  const EvidenceModel model(blocks, options);
  const ForwardState at = model.first_guess();
  const Whitened data = model.whiten(model.linearise(at), Scatter::nominal, 0);
  std::vector<Subset> tried;
  const Fit fit = model.make_fit(data, model.search(data, tried, true), at);
  for (const char* name :
       {"misalignment", "non_orthogonality", "offset_tempco", "drift", "hysteresis"}) {
    EXPECT_TRUE(fit.contains(name)) << name;
  }
  EXPECT_FALSE(fit.contains("second_order"));
}

TEST(EvidenceSubsets, ShapesShareThePriorOfTheirEffect) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  const std::vector<int> warm_up = model.groups_of("warm_up");
  ASSERT_EQ(warm_up.size(), 24U) << "six time constants, four sizes";
  EXPECT_NEAR(model.log_prior({warm_up[2]}), log_prior_of_count(1) - std::log(24), 1e-12);
  const std::vector<int> gravity = model.groups_of("local_gravity");
  EXPECT_NEAR(model.log_prior(gravity), log_prior_of_count(1), 1e-12);
  EXPECT_TRUE(model.groups_of("clock_error").empty()) << "it does not act on the means";
}

TEST(EvidenceSubsets, SearchFindsAPairOfEffects) {
  const Eigen::Vector3d tempco(0.4, -0.3, 0.5);
  const Eigen::Vector3d drift(8, -6, 9);
  const auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d {
        return (b.temperature_c - kReference_c) * tempco + b.middle_s / 3600 * drift;
      },
      2, 300);
  const EvidenceModel model(blocks, {});
  const ForwardState at = model.first_guess();
  const Whitened data = model.whiten(model.linearise(at), Scatter::nominal, 0);
  std::vector<Subset> tried;
  const Subset best = model.search(data, tried);
  const Fit fit = model.make_fit(data, best, at);
  EXPECT_TRUE(fit.contains("offset_tempco"));
  EXPECT_TRUE(fit.contains("drift"));
  for (Eigen::Index a = 0; a < 3; ++a) {
    EXPECT_NEAR(fit.state.tempco_mg_per_c[a], tempco[a], 0.1);
    EXPECT_NEAR(fit.state.drift_mg_per_h[a], drift[a], 0.6);
  }
  for (const Subset& subset : tried) {
    EXPECT_LE(subset.nats, best.nats);
  }
}

TEST(EvidenceSubsets, AnEstimateFarBeyondAnEffectsSizeHasNoEvidence) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return (b.temperature_c - kReference_c) * Eigen::Vector3d(15, 0, 0);
  });
  const EvidenceModel model(blocks, {});
  const Whitened data = model.whiten(model.linearise(model.first_guess()), Scatter::nominal, 0);
  EXPECT_LT(model.evidence(data, {model.groups_of("offset_tempco").front()}), -1e5)
      << "15 mg/C is more than four times the largest size";
}

// Gains, offsets and three of a drift are determined by 54 rows; its ripple, which needs the
// blocks' times in the recording, is not: the prior determines it.
TEST(EvidenceSubsets, FreedomCountsWhatTheDataDetermine) {
  const auto blocks = tests::made_dwells(
      [](const Block& b) -> Eigen::Vector3d {
        return b.middle_s / 3600 * Eigen::Vector3d(9, -6, 7);
      },
      5, 120);
  const EvidenceModel model(blocks, tests::only({"drift"}));
  const ForwardState at = model.first_guess();
  const Whitened data = model.whiten(model.linearise(at), Scatter::nominal, 0);
  std::vector<Subset> tried;
  const Fit fit = model.make_fit(data, model.search(data, tried), at);
  ASSERT_EQ(fit.posterior.columns.size(), 6U + 21);
  EXPECT_NEAR(model.freedom_of(fit), 54 - 9, 0.1);
}

}  // namespace
}  // namespace sixpoint::gap
