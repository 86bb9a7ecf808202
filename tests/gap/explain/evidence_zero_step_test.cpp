// A zero that moves once.
#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

TEST(EvidenceZeroStep, SizeAndEvidence) {
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

// Noise alone: a step at one of so many moments, of unknown size, is less likely than none.
TEST(EvidenceZeroStep, NoiseAloneHasNone) {
  for (const unsigned seed : {11U, 12U, 13U, 14U}) {
    const auto blocks = tests::made_dwells({}, seed);
    const EvidenceModel model(blocks, only({}));
    const ForwardState at = model.first_guess();
    const Whitened data = model.whiten(model.linearise(at), Scatter::nominal, 0);
    const std::optional<Fit> fit = fit_zero_step(model, data, at);
    ASSERT_TRUE(fit);
    EXPECT_LT(fit->nats, model.evidence(data, {})) << seed;
  }
}

// The offset that the fit reports is the zero before the step: 0 here, known to a mean's noise.
TEST(EvidenceZeroStep, TheStepIsTakenOffTheValues) {
  const auto blocks = tests::made_dwells(
      [](const Block& b) -> Eigen::Vector3d {
        return b.placement >= 6 ? Eigen::Vector3d(6, 6, -6) : Eigen::Vector3d(0, 0, 0);
      },
      15);
  const EvidenceModel model(blocks, only({}));
  const ForwardState at = model.first_guess();
  EXPECT_GT(at.offset_mg.cwiseAbs().minCoeff(), 2) << "before: a mean of both";
  const auto fit = fit_zero_step(model, model.whiten(model.linearise(at), Scatter::nominal, 0), at);
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->state.offset_mg.cwiseAbs().maxCoeff(), 0.4);
}

}  // namespace
}  // namespace sixpoint::gap
