#include "gap/judge/findings.h"

#include <limits>

#include <gtest/gtest.h>

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {
namespace {

struct Asked {
  DiagnoseOptions options;
  Bundle bundle{};
  Request request{bundle, options};
};

TEST(Findings, ProbabilityFromNats) {
  const Asked asked;
  Findings found;
  found.add(asked.request, {.name = "drift", .nats = std::log(19.0)});
  EXPECT_NEAR(found.effects.front().probability, 0.95, 1e-12);
  // Another cause at even odds with the effect: of 19 : 1 : 19.
  found.add(asked.request, {.name = "tilt", .nats = std::log(19.0), .other_nats = 0});
  EXPECT_NEAR(found.effects.back().probability, 19.0 / 39, 1e-12);
  EXPECT_NEAR(probability_of(1000), 1 / (1 + std::exp(-9)), 1e-15) << "never quite certain";
}

// What closes most of the gap comes first, however sure the others are.
TEST(Findings, EffectsAreOrderedByTheirShareOfTheGap) {
  Asked asked;
  asked.options.matters_mg = 1;
  Findings found;
  found.add(asked.request, {.name = "drift",
                            .nats = 500,
                            .parameters = {{"mg_per_h", {1, 0, 0}, {0.1, 0, 0}}},
                            .gap_mg2 = 0.25});
  found.add(asked.request, {.name = "tilt",
                            .nats = 9,
                            .parameters = {{"rotation_vector_deg", {1, 0, 0}, {0.1, 0, 0}}},
                            .gap_mg2 = 9});
  Diagnosis out;
  out.gap.before_mg = 4;
  out.gap.floor_mg = std::sqrt(6.0);
  finish(asked.request, found, out);
  ASSERT_EQ(out.effects.size(), 2U);
  EXPECT_EQ(out.effects[0].name, "tilt");
  EXPECT_NEAR(out.effects[0].share_of_gap, 9 / 9.25, 1e-12);
  EXPECT_NEAR(out.effects[1].share_of_gap, 0.25 / 9.25, 1e-12);
  EXPECT_GT(out.effects[0].probability_it_matters, 0.99) << "3 +- 0.3 mg";
  EXPECT_LT(out.effects[1].probability_it_matters, 1e-6) << "0.5 +- 0.05 mg";
  Findings larger;
  larger.add(asked.request, {.name = "drift", .nats = 500, .gap_mg2 = 8});
  larger.add(asked.request, {.name = "tilt", .nats = 9, .gap_mg2 = 12});
  finish(asked.request, larger, out);
  ASSERT_EQ(out.effects.size(), 2U);
  EXPECT_NEAR(out.effects[0].share_of_gap, 0.6, 1e-12) << "of 20 mg^2";
  EXPECT_NEAR(out.effects[1].share_of_gap, 0.4, 1e-12);
  // Something unknown of sqrt(5) mg beside them.
  larger.alarm(100, "what");
  out.gap.after_mg = std::sqrt(11.0);
  finish(asked.request, larger, out);
  EXPECT_NEAR(out.effects[0].share_of_gap, 12.0 / 25, 1e-12);
  for (const EffectFinding& candidate : out.candidates) {
    if (candidate.name == "tilt") {
      EXPECT_EQ(candidate.share_of_gap, out.effects[0].share_of_gap);
    }
  }
}

TEST(Findings, NineToOneIsAccepted) {
  const Asked asked{{.without = {"flicker"}}};
  Findings found;
  found.add(asked.request, {.name = "drift", .nats = 2.3});
  found.add(asked.request, {.name = "tilt", .nats = 2.1});
  found.add(asked.request, {.name = "flicker", .nats = 50});
  EXPECT_TRUE(found.accepted("drift"));
  EXPECT_FALSE(found.accepted("tilt"));
  EXPECT_EQ(found.candidates.size(), 2U) << "what is not allowed is no candidate";
}

// The table of findings.h.
TEST(Findings, LikelyOnesAreAcceptedAmongManyAndWhereOnlyTheNameIsInDoubt) {
  const Asked asked;
  struct Case {
    std::size_t before;
    bool unnamed;
    double nats;
    bool accepted;
  };
  for (const Case& c :
       {Case{0, false, 1, false}, Case{1, false, 1, false}, Case{0, false, 2.3, true},
        Case{0, true, 0.1, true}, Case{0, true, -0.1, false}, Case{2, false, 0.1, true},
        Case{2, false, -0.1, false}, Case{2, true, 0.1, true}, Case{9, false, 2.1, true}}) {
    Findings found;
    found.add(asked.request, {.name = "drift", .nats = 9});
    found.add(asked.request, {.name = "tilt", .nats = 8});
    found.add(asked.request, {.name = "second_order", .nats = c.nats});
    found.accept_likely(c.before, c.unnamed);
    EXPECT_EQ(found.accepted("second_order"), c.accepted)
        << c.before << " " << c.unnamed << " " << c.nats;
    EXPECT_TRUE(found.accepted("drift"));
    EXPECT_EQ(found.effects.size(), c.accepted ? 3U : 2U);
  }
}

// More evidence, of tests or of other causes, alarms or not, never makes it less probable.
TEST(Findings, UnknownGrowsWithItsEvidence) {
  const Asked asked;
  const auto probability = [&](double sd, double nats) {
    Findings found;
    found.test(sd, "a test");
    found.suspect(nats);
    Diagnosis out;
    finish(asked.request, found, out);
    EXPECT_EQ(out.unknown.present, sd > kAlarm_sd);
    return out.unknown.probability;
  };
  double last = 0;
  for (double sd = 2; sd < 9; sd += 0.5) {
    EXPECT_GT(probability(sd, -20), last);
    last = probability(sd, -20);
  }
  EXPECT_LT(probability(3, -20), 0.06);
  EXPECT_GT(probability(3, 2.5), 0.3) << "another cause just below its threshold";
  EXPECT_NEAR(probability(kAlarm_sd, -20), probability(0, kUnknownWins_nats), 1e-12);
  EXPECT_NEAR(probability(20, -20), 0.95, 1e-6);
}

// What the catalogue lacks often looks like what it has.
TEST(Findings, ANameIsLessProbableBesideSomethingUnknown) {
  const Asked asked;
  double last = 1;
  for (double sd = 2; sd < 9; sd += 0.5) {
    Findings found;
    found.add(asked.request, {.name = "tilt", .nats = 100});
    found.test(sd, "a test");
    Diagnosis out;
    finish(asked.request, found, out);
    EXPECT_LT(out.effects.front().probability, last);
    last = out.effects.front().probability;
    EXPECT_EQ(out.candidates.front().probability, last);
    if (sd == 2) {
      EXPECT_GT(last, 0.99);
    }
  }
  EXPECT_NEAR(last, 0.5, 0.01);
}

TEST(Findings, TestsAlarmBeyondTheirThreshold) {
  Findings found;
  found.test(5.4, "quiet");
  EXPECT_TRUE(found.alarms.empty());
  found.test(5.6, "loud");
  ASSERT_EQ(found.alarms.size(), 1U);
  EXPECT_EQ(found.alarms.front().where, "loud");
  Findings more;
  more.test(3, "later");
  more.outside_means = {{"wrap", 4}};
  found.append(std::move(more));
  EXPECT_EQ(found.worst_sd, 5.6);
  EXPECT_EQ(found.outside_means.size(), 1U);
}

// Quantiles of chi-square from tables (Abramowitz and Stegun, table 26.8).
TEST(Findings, ChiSquareInStandardDeviations) {
  EXPECT_NEAR(chi_to_sd(18.307, 10), 1.645, 0.01);  // 95 %
  EXPECT_NEAR(chi_to_sd(29.588, 10), 3.090, 0.03);  // 99.9 %
  EXPECT_NEAR(chi_to_sd(99.334, 100), 0, 0.01);     // median
  EXPECT_EQ(chi_to_sd(5, 0), 0);
}

TEST(Findings, VerdictFromEffectsAndAlarms) {
  const Asked asked;
  for (const bool effect : {false, true}) {
    for (const bool alarm : {false, true}) {
      Findings found;
      if (effect) {
        found.add(asked.request, {.name = "drift", .nats = 9});
      }
      if (alarm) {
        found.alarm(6.5, "somewhere");
      }
      Diagnosis out;
      finish(asked.request, found, out);
      EXPECT_EQ(out.verdict, alarm ? (effect ? Verdict::partly_explained : Verdict::unexplained)
                                   : (effect ? Verdict::explained : Verdict::no_gap));
      EXPECT_NEAR(out.unknown.probability, alarm ? 0.804 : 0.03, 0.01);
      EXPECT_EQ(out.candidates.size(), catalogue().size());
    }
  }
}

// The last row of the table of finish(): what is no number passes every comparison.
TEST(Findings, WhatIsNoFiniteNumberIsNoAnswer) {
  const Asked asked;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  for (const double wrong : {kNone, kEndless, -kEndless}) {
    for (const bool in_gap : {false, true}) {
      Findings found;
      found.add(asked.request, {.name = "drift", .nats = in_gap ? 9 : wrong});
      Diagnosis out;
      out.gap.after_mg = in_gap ? wrong : 0;
      out.not_observable.emplace_back("tilt", "yaw");
      finish(asked.request, found, out);
      EXPECT_FALSE(out.usable()) << wrong << in_gap;
      EXPECT_EQ(out.verdict, Verdict::unexplained);
      EXPECT_TRUE(out.effects.empty());
      EXPECT_EQ(out.gap.after_mg, 0) << "nothing is said of it";
      EXPECT_EQ(out.not_observable.size(), catalogue().size()) << "each once";
      for (const EffectFinding& candidate : out.candidates) {
        EXPECT_LE(candidate.probability, 0.5) << candidate.name;
      }
    }
  }
}

TEST(Findings, BeyondTheDatasheetIsSaid) {
  const Asked asked;
  Findings found;
  found.add(asked.request,
            {.name = "offset_tempco", .nats = 9, .parameters = {{"mg_per_c", {0.2, -1.4, 0}, {}}}});
  found.add(asked.request, {.name = "sensitivity_tempco",
                            .nats = 8,
                            .parameters = {{"percent_per_c", {0.04, 0, 0}, {}}}});
  Diagnosis out;
  finish(asked.request, found, out);
  EXPECT_TRUE(out.effects[0].outside_datasheet) << "1 mg/C is the limit";
  EXPECT_FALSE(out.effects[1].outside_datasheet) << "0.05 %/C is the limit";
}

TEST(Findings, InconclusiveNamesNothing) {
  const Asked asked{{.without = {"tilt"}}};
  Findings found;
  found.add(asked.request, {.name = "idle_sleep", .nats = 1000});
  const Diagnosis d = inconclusive(asked.options, found, "too little", {});
  EXPECT_FALSE(d.usable());
  EXPECT_TRUE(d.effects.empty());
  EXPECT_EQ(d.verdict, Verdict::unexplained);
  EXPECT_TRUE(d.unknown.present);
  EXPECT_EQ(d.unknown.probability, 0.5);
  EXPECT_EQ(d.unknown.why.front(), "too little");
  EXPECT_EQ(d.not_observable.size(), catalogue().size() - 1);
  for (const EffectFinding& candidate : d.candidates) {
    EXPECT_LE(candidate.probability, 0.5);
  }
}

TEST(Findings, ParametersHaveTheContractsNames) {
  EXPECT_EQ(parameter_name("tilt"), "rotation_vector_deg");
  EXPECT_EQ(parameter_name("random_walk"), "mg_per_sqrt_s");
  EXPECT_EQ(parameter_name("wrap"), "");
}

}  // namespace
}  // namespace sixpoint::gap
