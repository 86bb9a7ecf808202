#include "gap/benchmark/labels.h"

#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gap {
namespace {

// Faces only: where each axis is along each direction of the room for a third of the time.
GapTrial trial_of(const std::string& effects, TrialEffect truth) {
  GapTrial trial;
  trial.kind = TrialKind::single;
  trial.effects = {std::move(truth)};
  trial.scenario = *sim::parse_scenario(R"({"schema": "sixpoint/scenario/1", "seed": 4,
      "protocol": "production", "rate_hz": 100, "effects": )" +
                                        effects + "}");
  return trial;
}

// The information in a known line of 6 mg along X of the room, 18000 samples, in closed form:
// 18000 * 18 / 3 * (2 / 16.4816 + 1 / 31.5216) mg^-2 mg^2 = 16530: index 128.6, bound 3. What lies
// within 1.25 counts of zero, a tenth of the energy at most, is left out.
TEST(Labels, SizeOfALineOverItsBoundByItsClosedForm) {
  const auto label =
      label_of(trial_of(R"([{"name": "floor_vibration", "parameters": {"vector_mg": [6, 0, 0],
                   "frequency_hz": 11}}])",
                        {"floor_vibration", 4}),
               "b1");
  ASSERT_OK(label);
  ASSERT_EQ(label->effects.size(), 1U);
  EXPECT_NEAR(label->effects[0].size_over_bound, 128.6 / 3, 0.1 * 128.6 / 3);
  EXPECT_EQ(label->effects[0].family, "line");
  EXPECT_TRUE(label->effects[0].must());
  EXPECT_TRUE(label->where.empty());
}

// Three minutes of six faces show no thermal gain, and a clock hardly.
TEST(Labels, WhatTheProtocolDoesNotShowIsBelowTheBound) {
  const auto gain = label_of(trial_of(R"([{"name": "sensitivity_tempco", "parameters":
                                          {"percent_per_c": [0.03, 0.03, 0.03]}}])",
                                      {"sensitivity_tempco", 1}),
                             "b1");
  ASSERT_OK(gain);
  EXPECT_LT(gain->effects[0].size_over_bound, 0.5);
  EXPECT_FALSE(gain->effects[0].must());
  const auto clock = label_of(
      trial_of(R"([{"name": "clock_error", "parameters": {"ppm": [10]}}])", {"clock_error", 0.02}),
      "b1");
  ASSERT_OK(clock);
  EXPECT_LT(clock->effects[0].size_over_bound, 0.5);
}

TEST(Labels, OutsideKindsSayWhere) {
  // A step of the zero half way shows on some axis in some segment, and has no name there.
  TrialShares outside;
  outside.none = 0;
  outside.outside = 1;
  const auto trial = draw_trial(3, 1, sim::StandardProtocol::production, outside, {"zero_step"});
  if (!trial || trial->kind != TrialKind::outside) {
    GTEST_FAIL() << "no such kind";
  }
  const auto label = label_of(*trial, "b1");
  ASSERT_OK(label);
  EXPECT_FALSE(label->where.empty());
  EXPECT_FALSE(sim::find_effect(label->effects[0].name));
}

TEST(Labels, NamesSayNothingAndDiffer) {
  std::set<std::string> names;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    names.insert(bundle_name(5, i));
  }
  EXPECT_EQ(names.size(), 1000U);
  EXPECT_EQ(bundle_name(5, 3), bundle_name(5, 3));
  EXPECT_NE(bundle_name(5, 3), bundle_name(6, 3));
}

TEST(Labels, ReadAsWritten) {
  Labels labels;
  labels.seed = 7;
  labels.protocol = "production";
  labels.trials = {{"b1", TrialKind::none, {}, {}},
                   {"b2", TrialKind::outside, {{"creep", "creep", 1.5, 4.25}}, {{2, "faces"}}}};
  const auto again = parse_labels(labels_text(labels));
  ASSERT_OK(again);
  EXPECT_EQ(again->seed, 7U);
  EXPECT_EQ(again->protocol, "production");
  ASSERT_EQ(again->trials.size(), 2U);
  EXPECT_EQ(again->trials[1].kind, TrialKind::outside);
  EXPECT_EQ(again->trials[1].effects[0].size_over_bound, 4.25);
  EXPECT_EQ(again->trials[1].where, labels.trials[1].where);
}

TEST(Labels, WhatIsNoLabelIsSaidWithItsLine) {
  const std::string head = R"({"schema": "sixpoint/gap-labels/1", "seed": 1})"
                           "\n";
  const std::string good = R"({"bundle": "b1", "kind": "none", "effects": [], "where": []})"
                           "\n";
  EXPECT_OK(parse_labels(head + good));
  const std::vector<std::string> bad = {
      "",
      head,
      good,
      head + good + good,
      head + "nonsense\n",
      head + R"({"bundle": "b1", "kind": "odd", "effects": [], "where": []})",
      head + R"({"bundle": "b1", "kind": "single", "effects": [], "where": []})",
      head + R"({"bundle": "b1", "kind": "single", "effects": [{"name": "tilt"}], "where": []})",
      head + R"({"bundle": "b1", "kind": "single", "effects": [{"name": "tilt", "family": "x",
             "severity": 1, "size_over_bound": -1}], "where": []})",
      head + R"({"bundle": "b1", "kind": "none", "effects": [], "where": [{"axis": "W"}]})",
  };
  for (const std::string& text : bad) {
    EXPECT_FAILS(parse_labels(text), ErrorCode::bad_data);
  }
  EXPECT_EQ(parse_labels(head + good + good).error().where, "line 3 of the labels");
}

}  // namespace
}  // namespace sixpoint::gap
