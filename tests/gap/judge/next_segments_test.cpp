#include "gap/judge/next_segments.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "gap/explain/catalogue.h"
#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

TEST(InformationNats, ReachesHalfABitAtTheShannonLimitOfABinaryInput) {
  // A binary input in Gaussian noise carries half a bit at Eb/N0 = 0.187 dB (Proakis, Digital
  // Communications, 7.2). With Es = Eb / 2 and a variance of N0 / 2 the weight, half of the squared
  // distance in standard deviations, is 2 Eb / N0.
  EXPECT_NEAR(information_nats(0.5, 2 * std::pow(10, 0.0187)), 0.5 * std::log(2), 1e-4);
}

TEST(InformationNats, LiesBetweenNothingAndTheEntropy) {
  const auto entropy = [](double p) { return -p * std::log(p) - (1 - p) * std::log(1 - p); };
  for (const double p : {0.03, 0.5, 0.9}) {
    EXPECT_EQ(information_nats(p, 0), 0);
    // To first order p (1 - p) times the weight both ways: half the sum of the two divergences.
    EXPECT_NEAR(information_nats(p, 1e-4), p * (1 - p) * 1e-4, 1e-7);
    EXPECT_NEAR(information_nats(p, std::numeric_limits<double>::infinity()), entropy(p), 1e-12);
    double last = 0;
    for (const double weight : {0.1, 0.5, 2.0, 8.0, 50.0}) {
      const double nats = information_nats(p, weight);
      EXPECT_GT(nats, last) << p << " " << weight;
      EXPECT_LE(nats, entropy(p));
      last = nats;
    }
    EXPECT_NEAR(last, entropy(p), 1e-6);
  }
  EXPECT_EQ(information_nats(0, 5), 0) << "what is certain has no question";
  EXPECT_EQ(information_nats(1, 5), 0);
}

// Six faces three times, diagnosed; what to record next.
std::map<std::string, NextSegment> offers_for(const tests::Made& made, const Findings& given = {}) {
  const auto answer = diagnose(made.bundle, made.options);
  EXPECT_TRUE(answer);
  const std::vector<ToneFit> tones;
  const Records records = {
      made.clean, made.noise, code_statistics(made.bundle, made.clean),       {}, {}, 0, {},
      {},         {},         slow_noise(made.bundle, made.clean, made.noise)};
  const std::vector<Block> blocks =
      make_blocks(made.bundle, made.clean, made.noise, tones, records.response);
  const Explanation explanation = explain(made.request, blocks, records.slow);
  Findings found = judge_means(made.request, explanation, records.slow, {});
  found.append(given);
  Diagnosis out;
  out.not_observable = answer->not_observable;
  std::map<std::string, NextSegment> offers;
  for (const NextSegment& next :
       next_segments(made.request, protocol_kind(made.bundle).abilities, explanation, found, out)) {
    offers[next.name] = next;
  }
  return offers;
}

bool separates(const NextSegment& next, const std::string& what) {
  return std::find(next.separates.begin(), next.separates.end(), what) != next.separates.end();
}

TEST(NextSegments, OneRowForEachSortOfQuestion) {
  const tests::Made made(tests::made_production({}));
  EffectFinding geometry{.name = "tilt", .probability = 0.95, .confounded_with = {"misalignment"}};
  EffectFinding line{.name = "wrap", .probability = 0.99, .confounded_with = {"saturation"}};
  Findings given;
  given.effects = {geometry, line};
  const auto offers = offers_for(made, given);
  // Not observable, in the means: a shaker bends K2 out of the zero's and gain's way.
  EXPECT_TRUE(separates(offers.at("shaker"), "second_order"));
  EXPECT_TRUE(separates(offers.at("soak"), "sensitivity_tempco"));
  EXPECT_TRUE(separates(offers.at("still"), "drift"));
  // Not observable, in the samples.
  EXPECT_TRUE(separates(offers.at("shaker"), "soft_mount"));
  EXPECT_TRUE(separates(offers.at("shaker_high"), "jitter"));
  // Two that look alike: by yaws, since they turn one against the other; in the samples by tones.
  EXPECT_TRUE(separates(offers.at("yaw"), "tilt/misalignment"));
  EXPECT_TRUE(separates(offers.at("shaker_high"), "wrap/saturation"));
  EXPECT_FALSE(offers.contains("shaker") && separates(offers.at("shaker"), "wrap/saturation"));
  // The protocol still lacks what it needs.
  for (const auto& [name, next] : offers) {
    EXPECT_FALSE(name != "soak" && separates(next, "sensitivity_tempco")) << name;
    EXPECT_FALSE(separates(next, "rounding_floor")) << name << ": no protocol shows it";
  }
}

TEST(NextSegments, WhatIsNamedForCertainIsNotAsked) {
  const tests::Made made(
      tests::made_production({}, [](const Segment& segment, double) -> Eigen::Vector3d {
        return Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX()) * segment.rotation.col(2);
      }));
  for (const auto& [name, next] : offers_for(made)) {
    EXPECT_FALSE(separates(next, "misalignment")) << name << ": 1.1 degrees, beyond all doubt";
  }
}

TEST(NextSegments, WhatIsKnownIsNotAsked) {
  // With the effect out of the catalogue no segment speaks of it.
  DiagnoseOptions options;
  options.without = {"second_order"};
  for (const auto& [name, next] : offers_for(tests::Made(tests::made_production({}), options))) {
    EXPECT_FALSE(separates(next, "second_order")) << name;
    EXPECT_GT(next.expected_nats, 0);
    EXPECT_GT(next.minutes, 0);
  }
}

// A record of raw counts, as a jig run is, has no constants that could be of another filter: no
// segment of such a record shows it.
TEST(NextSegments, OfRawCountsTheFilterMismatchIsNotAsked) {
  DiagnoseOptions options;
  options.uncalibrated = true;
  const tests::Made made(tests::made_production({}), options);
  EffectFinding gain{.name = "gain", .probability = 0.95, .confounded_with = {"filter_mismatch"}};
  Findings given;
  given.effects = {gain};
  const auto offers = offers_for(made, given);
  EXPECT_FALSE(offers.empty());
  for (const auto& [name, next] : offers) {
    for (const std::string& effect : next.separates) {
      EXPECT_EQ(effect.find("filter_mismatch"), std::string::npos) << name << ": " << effect;
    }
  }
}

}  // namespace
}  // namespace sixpoint::gap
