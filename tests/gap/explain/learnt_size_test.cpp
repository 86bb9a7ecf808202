// The table of learnt_size.h, and what a learnt size does to the evidence.
#include "gap/explain/learnt_size.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/evidence.h"
#include "gap/explain/made_blocks.h"
#include "gap/explain/made_marginal.h"

namespace sixpoint::gap {
namespace {

TEST(LearntSize, PresenceIsAtMostEven) {
  EXPECT_EQ(learnt_log_prior({.effect = "tilt", .units = 12}), 0) << "all had it";
  EXPECT_NEAR(learnt_log_prior({.effect = "tilt", .units = 10, .share_of_units = 0.3}),
              std::log(3.5 / 7.5), 1e-12)
      << "3 of 10";
  EXPECT_EQ(learnt_log_prior({.effect = "tilt", .units = 200, .share_of_units = 0}),
            kLogPriorEffect)
      << "none had it";
  EXPECT_EQ(learnt_log_prior({.effect = "tilt"}), 0) << "written by hand";
}

// Two effects of one kind of prior each: the learnt one is beside the catalogue's sizes, not in
// their place, and does not count among the many effects of a real unit.
TEST(LearntSize, StandsBesideTheSizesOfTheCatalogue) {
  const auto blocks = tests::made_dwells();
  EvidenceOptions options;
  const EvidenceModel before(blocks, options);
  options.learnt = {{.effect = "tilt", .units = 9, .mean = {0.3, 0.1}, .sd = {0.02, 0.03}},
                    {.effect = "gain", .units = 9, .mean = {1, 1, 1}, .sd = {1, 1, 1}},
                    {.effect = "drift", .units = 9, .mean = {1}, .sd = {1}}};
  const EvidenceModel model(blocks, options);
  EXPECT_EQ(model.group_count(), before.group_count() + 1)
      << "gains are free, and a drift has three numbers";
  const std::vector<int> tilt = model.groups_of("tilt");
  ASSERT_EQ(tilt.size(), before.groups_of("tilt").size() + 1);
  const int learnt = tilt.back();
  EXPECT_EQ(model.first_column(learnt), model.first_column(tilt.front()));
  EXPECT_EQ(model.group(learnt).mean_of(1), 0.1);
  EXPECT_EQ(model.group(learnt).sd_of(1), 0.03);
  EXPECT_EQ(model.log_prior({learnt}), 0);
  EXPECT_EQ(model.log_prior({tilt.front()}), before.log_prior({tilt.front()}));
}

// Oracle: the marginal likelihood by way of the covariance of the values (made_marginal.h).
TEST(LearntSize, EvidenceIsTheMarginalLikelihoodAboutTheLearntMean) {
  const auto blocks = tests::made_dwells();
  EvidenceOptions options;
  options.learnt = {{.effect = "tilt", .units = 9, .mean = {0.3, 0.1}, .sd = {0.02, 0.03}}};
  const EvidenceModel model(blocks, options);
  const Eigen::MatrixXd linear = model.linearise(model.first_guess());
  const Whitened data = model.whiten(linear, Scatter::nominal, 0);
  const int learnt = model.groups_of("tilt").back();
  ASSERT_TRUE(model.group(learnt).learnt);
  EXPECT_NEAR(model.evidence(data, {learnt}), tests::marginal(model, linear, {learnt}).nats(),
              1e-3);
}

}  // namespace
}  // namespace sixpoint::gap
