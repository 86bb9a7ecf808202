#include "gap/challenge/suggestion.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/judge/next_segments.h"
#include "sim/standard_protocol.h"

namespace sixpoint::gap {
namespace {

sim::Scenario production() {
  auto trial = draw_trial(5, 0, sim::StandardProtocol::production, {.none = 1});
  EXPECT_TRUE(trial);
  return trial->scenario;
}

TEST(Follow, TheSameUnitGoesOnAfterTheLastSegment) {
  sim::Scenario scenario = production();
  const auto before = sim::record_protocol(*scenario.protocol);
  const std::size_t had = scenario.protocol->segments.size();
  ASSERT_TRUE(follow(scenario, "yaw"));
  const auto after = sim::record_protocol(*scenario.protocol);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(scenario.protocol->segments.size(), had + 24);
  EXPECT_EQ(scenario.protocol->segments[had].name, "yaw");
  // What was recorded is recorded again, sample by sample.
  ASSERT_GT(after->counts.size(), before->counts.size());
  EXPECT_TRUE(std::equal(before->counts.begin(), before->counts.end(), after->counts.begin()));
  EXPECT_GT(scenario.protocol->segments[had].host_start_s,
            scenario.protocol->segments[had - 1].host_start_s + 10);
}

TEST(Follow, EverySegmentOfferedTakesTheTimeThatIsSaid) {
  // Minutes of gap/judge/next_segments.cpp, which knows nothing of sim/.
  for (const Offer& offer : standard_offers()) {
    const std::string& name = offer.name;
    sim::Scenario scenario = production();
    const double from_s = scenario.protocol->segments.back().host_start_s;
    ASSERT_TRUE(follow(scenario, name)) << name;
    const auto& last = scenario.protocol->segments.back();
    const double took_s = last.host_start_s + static_cast<double>(last.samples) / 100 - from_s - 10;
    EXPECT_NEAR(took_s / 60, offer.minutes(), 0.15 * offer.minutes()) << name;
    EXPECT_GE(scenario.protocol->temperature.back().host_time_s, last.host_start_s);
  }
  sim::Scenario scenario = production();
  EXPECT_FALSE(follow(scenario, "handstand"));
}

Outcome answered(std::vector<TrialEffect> truth, std::vector<std::pair<std::string, double>> named,
                 std::vector<std::pair<std::string, double>> others = {}) {
  Outcome outcome;
  outcome.kind = TrialKind::realistic;
  outcome.truth = std::move(truth);
  outcome.named = named;
  outcome.candidates = std::move(named);
  outcome.candidates.insert(outcome.candidates.end(), others.begin(), others.end());
  outcome.suggestions = {{"yaw", 6.4, 1.5}};
  return outcome;
}

TEST(GainOf, CountsTheSameEffectsBeforeAndAfter) {
  const std::vector<TrialEffect> two = {{"tilt", 1}, {"drift", 1}};
  const std::vector<TrialEffect> one = {{"tilt", 1}};
  const Gain gain = gain_of(
      {{answered(two, {{"tilt", 0.95}}, {{"drift", 0.15}}),
        answered(two, {{"tilt", 1.0}, {"drift", 0.95}})},
       {answered(one, {{"wrap", 0.9}}, {{"tilt", 0.4}}), answered(one, {}, {{"tilt", 0.5}})}});
  EXPECT_EQ(gain.followed, 2);
  EXPECT_NEAR(gain.minutes, 6.4, 1e-12);
  EXPECT_EQ(gain.named_before.right, 1);
  EXPECT_EQ(gain.named_after.right, 2);
  EXPECT_EQ(gain.named_after.of, 3);
  EXPECT_EQ(gain.false_before.right, 1);
  EXPECT_EQ(gain.false_before.of, 2);
  EXPECT_EQ(gain.false_after.right, 0);
  EXPECT_NEAR(gain.probability_before.mean, 1.5 / 3, 1e-12);
  EXPECT_NEAR(gain.probability_after.mean, 2.45 / 3, 1e-12);
  EXPECT_NEAR(gain.named_gain.mean, 1.0 / 3, 1e-12);
  // Trials add 1 of 2 and 0 of 1 effects: residuals 1/3 and -1/3, two clusters.
  const double sd = std::sqrt(2.0 / 9 * 2 / 1) / 3;
  EXPECT_NEAR(gain.named_gain.interval[0], 1.0 / 3 - 1.96 * sd, 1e-12);
  EXPECT_NEAR(gain.named_gain.interval[1], 1.0 / 3 + 1.96 * sd, 1e-12);
  EXPECT_EQ(gain.by_segment.at("yaw").trials, 2);
}

TEST(GainOf, TrialsThatHaveNothingToFollowDoNotCount) {
  const std::vector<TrialEffect> one = {{"tilt", 1}};
  Outcome outside = answered(one, {});
  outside.kind = TrialKind::outside;
  Outcome content = answered(one, {{"tilt", 1}});
  content.suggestions.clear();
  Outcome failed = answered(one, {});
  failed.failure = "exit code 70";
  const Gain gain =
      gain_of({{outside, outside}, {content, {}}, {failed, {}}, {answered(one, {}), failed}});
  EXPECT_EQ(gain.followed, 0);
  EXPECT_EQ(gain.nothing_to_do, 1);
  EXPECT_EQ(gain.named_before.of, 0);
}

}  // namespace
}  // namespace sixpoint::gap
