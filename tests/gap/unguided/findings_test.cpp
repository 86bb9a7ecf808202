#include "gap/unguided/findings.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

EffectFinding finding_of(const std::string& name) {
  EffectFinding finding;
  finding.name = name;
  return finding;
}

// The table of findings.h, row by row.
TEST(Findings, VerdictByWhatWasFound) {
  for (const auto& [unknown, effects, expected] : {std::tuple{true, 0, Verdict::unexplained},
                                                   {true, 1, Verdict::partly_explained},
                                                   {false, 0, Verdict::no_gap},
                                                   {false, 2, Verdict::explained}}) {
    Diagnosis diagnosis;
    diagnosis.unknown.present = unknown;
    diagnosis.effects.resize(static_cast<std::size_t>(effects));
    finish(diagnosis, {});
    EXPECT_EQ(diagnosis.verdict, expected) << unknown << effects;
  }
}

// The table's last row: the answer is that of every other recording that says too little.
TEST(Findings, TooLittleDataIsNoVerdictOfItsOwn) {
  Diagnosis diagnosis;
  diagnosis.inconclusive = true;
  diagnosis.unknown.why = {"no still period"};
  diagnosis.effects = diagnosis.candidates = {finding_of("offset_tempco")};
  finish(diagnosis, {});
  EXPECT_EQ(diagnosis.verdict, Verdict::unexplained);
  EXPECT_TRUE(diagnosis.inconclusive);
  EXPECT_TRUE(diagnosis.effects.empty());
  EXPECT_TRUE(diagnosis.unknown.present);
  EXPECT_EQ(diagnosis.unknown.probability, 0.5);
  EXPECT_EQ(diagnosis.losses, std::vector<std::string>{"no still period"});
  EXPECT_FALSE(diagnosis.next_segments.empty()) << "what would say more";
}

TEST(Findings, WhatWasNotJudgedIsNotObservable) {
  DiagnoseOptions options;
  options.without = {"drift"};
  Diagnosis diagnosis;
  diagnosis.candidates = {finding_of("filter_mismatch")};
  finish(diagnosis, options);
  for (const auto& [name, segment] : diagnosis.not_observable) {
    EXPECT_NE(name, "filter_mismatch");
    EXPECT_NE(name, "drift");
  }
  EXPECT_EQ(diagnosis.candidates.size(), 1 + diagnosis.not_observable.size());
  EXPECT_FALSE(is_allowed(options, "drift"));
  EXPECT_TRUE(is_allowed(options, "tilt"));
}

// Odds of e^nats to 1, and never more than e^9 to 1.
TEST(Findings, ProbabilityOfEvidence) {
  EXPECT_NEAR(probability_of(0), 0.5, 1e-12);
  EXPECT_NEAR(probability_of(kAccept_nats), 0.9, 1e-3);
  EXPECT_NEAR(probability_of(std::log(3.0)), 0.75, 1e-12);
  EXPECT_EQ(probability_of(100), probability_of(9));
}

TEST(Findings, SizesOfTheGap) {
  GapSize gap;
  gap.before_mg = 10;
  gap.after_mg = 5;
  gap.floor_mg = 2.5;
  set_sigmas(gap);
  EXPECT_EQ(gap.before_sigma, 4);
  EXPECT_EQ(gap.after_sigma, 2);
  EXPECT_NEAR(closed_fraction(gap), 0.75, 1e-12);  // of the square
}

}  // namespace
}  // namespace sixpoint::gap
