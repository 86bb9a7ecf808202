// A test for each row of the table in rule.h.
#include "gap/adopt/rule.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/adopt/made_evidence.h"

namespace sixpoint::gap {
namespace {

using tests::made_document;
using tests::made_effect;
using tests::made_tempco;

AdoptionDecision only(const std::vector<DocumentEvidence>& documents) {
  const auto decisions = decide_adoption(documents);
  EXPECT_EQ(decisions.size(), 1U);
  return decisions.empty() ? AdoptionDecision() : decisions.front();
}

TEST(AdoptionRule, WhatTheSimulatorDoesNotHaveIsNeverAdopted) {
  std::vector<DocumentEvidence> documents;
  for (int i = 0; i < 6; ++i) {
    documents.push_back(made_document(i, "U" + std::to_string(i),
                                      {made_effect("supply_crosstalk", "mg", {3, 3, 3}, 0.1)}));
  }
  EXPECT_EQ(only(documents).outcome, AdoptionOutcome::not_simulated);
  EXPECT_FALSE(only(documents).adopted());
}

TEST(AdoptionRule, WhatNoProtocolShowsIsNotObservable) {
  std::vector<DocumentEvidence> documents = {made_document(1, "A", {made_tempco({0, 0, 0}, false)}),
                                             made_document(2, "B", {})};
  documents[0].not_observable = {"offset_tempco"};
  documents[1].not_observable = {"offset_tempco"};
  EXPECT_EQ(only(documents).outcome, AdoptionOutcome::not_observable);
  documents[0].not_observable.clear();
  documents[0].inconclusive = true;
  EXPECT_EQ(only(documents).outcome, AdoptionOutcome::not_observable) << "nothing conclusive";
}

TEST(AdoptionRule, BesideSomethingUnknownNothingIsAdopted) {
  std::vector<DocumentEvidence> documents;
  for (int i = 0; i < 5; ++i) {
    documents.push_back(made_document(i, "U" + std::to_string(i), {made_tempco({.4, .4, .4})}));
    documents.back().unknown = true;
  }
  EXPECT_EQ(only(documents).outcome, AdoptionOutcome::unknown_beside);
  // Two others say the same without it: they alone count.
  documents.push_back(made_document(10, "A", {made_tempco({.2, .2, .2})}));
  documents.push_back(made_document(11, "B", {made_tempco({.2, .2, .2})}));
  const AdoptionDecision two = only(documents);
  EXPECT_EQ(two.outcome, AdoptionOutcome::adopted);
  EXPECT_EQ(two.units(), 2U);
  EXPECT_NEAR(two.parameters[0].numbers[0].mean, 0.2, 1e-9);
}

TEST(AdoptionRule, WhatIsNotCertainIsNotNamed) {
  EffectEvidence weak = made_tempco({.4, .4, .4});
  weak.probability = 0.89;
  EffectEvidence confounded = made_tempco({.4, .4, .4});
  confounded.named = false;
  confounded.confounded = true;
  for (const EffectEvidence& effect : {weak, confounded, made_tempco({.1, .1, .1}, false)}) {
    EXPECT_EQ(only({made_document(1, "A", {effect}), made_document(2, "B", {effect})}).outcome,
              AdoptionOutcome::not_named);
  }
  weak.probability = 0.9;
  EXPECT_EQ(only({made_document(1, "A", {weak}), made_document(2, "B", {weak})}).outcome,
            AdoptionOutcome::adopted);
}

TEST(AdoptionRule, OfOneUnitTheSpreadIsNotKnown) {
  const AdoptionDecision one = only({made_document(1, "A", {made_tempco({.4, -.3, .2})}),
                                     made_document(2, "A", {made_tempco({.42, -.28, .22})})});
  EXPECT_EQ(one.outcome, AdoptionOutcome::one_unit);
  EXPECT_EQ(one.units(), 1U);
  EXPECT_EQ(one.bundles, 2U);
  EXPECT_NEAR(one.parameters[0].numbers[1].mean, -.29, 1e-9);
  EXPECT_FALSE(one.parameters[0].numbers[1].spread.has_value());
}

TEST(AdoptionRule, WhatOneOfSeveralUnitsHasIsItsOwn) {
  const std::vector<DocumentEvidence> documents = {
      made_document(1, "A", {made_tempco({.4, .4, .4})}),
      made_document(2, "A", {made_tempco({.4, .4, .4})}),  // the same unit again
      made_document(3, "B", {made_tempco({0, 0, 0}, false)}), made_document(4, "C", {})};
  const AdoptionDecision own = only(documents);
  EXPECT_EQ(own.outcome, AdoptionOutcome::its_own);
  EXPECT_EQ(own.units_naming, 1U);
  EXPECT_EQ(own.units_able, 3U);
}

TEST(AdoptionRule, SettingsThatDifferHaveNoMean) {
  const std::vector<double> turned = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  const std::vector<double> other = {1, 0, 0, 0, 0, -1, 0, 1, 0};
  const auto document = [](int number, const char* unit, const std::vector<double>& matrix) {
    return made_document(number, unit, {made_effect("axis_rotation", "matrix", matrix, 0)});
  };
  EXPECT_EQ(only({document(1, "A", turned), document(2, "B", other)}).outcome,
            AdoptionOutcome::no_mean);
  const AdoptionDecision same = only({document(1, "A", turned), document(2, "B", turned)});
  EXPECT_EQ(same.outcome, AdoptionOutcome::adopted);
  EXPECT_NEAR(same.parameters[0].numbers[1].mean, -1, 1e-9);
}

TEST(AdoptionRule, UnitsThatDifferInSignHaveASpreadOnly) {
  const AdoptionDecision both = only({made_document(1, "A", {made_tempco({.4, .3, -.2})}),
                                      made_document(2, "B", {made_tempco({-.4, -.2, .3})}),
                                      made_document(3, "C", {made_tempco({.1, -.2, -.1})})});
  EXPECT_EQ(both.outcome, AdoptionOutcome::spread_only);
  EXPECT_EQ(both.parameters[0].numbers[0].mean, 0);
  EXPECT_NEAR(both.parameters[0].numbers[0].spread.value_or(0), 0.4, 0.05);
}

TEST(AdoptionRule, AnythingElseIsAdopted) {
  const AdoptionDecision found = only({made_document(1, "A", {made_tempco({.4, -.3, .2})}),
                                       made_document(2, "B", {made_tempco({.5, -.4, .3})}),
                                       made_document(3, "C", {made_tempco({.3, -.2, .1})})});
  EXPECT_EQ(found.outcome, AdoptionOutcome::adopted);
  EXPECT_NEAR(found.parameters[0].numbers[0].mean, 0.4, 1e-6);
  EXPECT_NEAR(found.parameters[0].numbers[0].spread.value_or(0), std::sqrt(0.01 - 0.0001), 1e-6);
  EXPECT_EQ(found.share_of_units, 1);
}

// By how much the effect differs from its law is common to all units: it is no scatter of theirs, and
// they do not average it out. Closed form: the spread is sqrt(variance - scatter^2).
TEST(AdoptionRule, WhatUnitsShareIsNoScatterBetweenThem) {
  constexpr double kShare = 0.05;
  constexpr double kScatter = 0.004;
  std::vector<DocumentEvidence> shared;
  std::vector<DocumentEvidence> earlier;  // of a version that does not state it apart
  for (int i = 0; i < 5; ++i) {
    const double size = 0.4 + 0.02 * (i - 2);  // a variance of 2.5 * 0.02^2
    EffectEvidence effect = made_tempco({size, -size, 0});
    effect.parameters[0].form_sd = {kShare * size, kShare * size, 0};
    effect.parameters[0].sd = {std::hypot(kScatter, kShare * size),
                               std::hypot(kScatter, kShare * size), kScatter};
    shared.push_back(made_document(i, "U" + std::to_string(i), {effect}));
    effect.parameters[0].form_sd.clear();
    earlier.push_back(made_document(i, "U" + std::to_string(i), {effect}));
  }
  const double variance = 2.5 * 0.02 * 0.02;
  const auto numbers = only(shared).parameters[0].numbers;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    EXPECT_NEAR(numbers[axis].spread.value_or(0), std::sqrt(variance - kScatter * kScatter), 1e-6);
    EXPECT_NEAR(numbers[axis].standard_uncertainty,
                std::hypot(std::sqrt(variance / 5), kShare * 0.4), 1e-6);
  }
  EXPECT_NEAR(numbers[2].standard_uncertainty, kScatter / std::sqrt(5), 1e-9);
  EXPECT_NEAR(only(earlier).parameters[0].numbers[0].spread.value_or(0),
              std::sqrt(variance - kScatter * kScatter - std::pow(kShare * 0.4, 2)), 1e-3);
  EXPECT_NEAR(only({shared[0]}).parameters[0].numbers[0].standard_uncertainty,
              std::hypot(kScatter, kShare * 0.36), 1e-9)
      << "of one unit it is what the diagnosis states";
}

// Of an effect that every unit has some of, units that do not name it lower the mean.
TEST(AdoptionRule, SizesThatWereNotNamedCountToo) {
  const AdoptionDecision all = only({made_document(1, "A", {made_tempco({.4, .4, .4})}),
                                     made_document(2, "B", {made_tempco({.4, .4, .4})}),
                                     made_document(3, "C", {made_tempco({.4, .4, .4})}),
                                     made_document(4, "D", {made_tempco({0, 0, 0.01}, false)})});
  EXPECT_EQ(all.outcome, AdoptionOutcome::adopted);
  EXPECT_EQ(all.units(), 4U);
  EXPECT_EQ(all.units_naming, 3U);
  EXPECT_NEAR(all.parameters[0].numbers[0].mean, 0.3, 0.01);
  EXPECT_EQ(all.share_of_units, 1);
}

// Others are as large as in the units that have them; the share says how many do.
TEST(AdoptionRule, WhatSomeUnitsHaveKeepsItsSize) {
  const auto seat = [](int number, const char* unit, bool named) {
    return made_document(number, unit,
                         named ? std::vector{made_effect("seating", "sd_deg", {0.1}, 0.01)}
                               : std::vector<EffectEvidence>());
  };
  const AdoptionDecision half =
      only({seat(1, "A", true), seat(2, "B", true), seat(3, "C", false), seat(4, "D", false)});
  EXPECT_EQ(half.outcome, AdoptionOutcome::adopted);
  EXPECT_EQ(half.share_of_units, 0.5);
  EXPECT_NEAR(half.parameters[0].numbers[0].mean, 0.1, 1e-9);
}

// A unit names an effect if most of its documents do.
TEST(AdoptionRule, MostDocumentsOfAUnitDecide) {
  const std::vector<DocumentEvidence> documents = {
      made_document(1, "A", {made_tempco({.4, .4, .4})}),
      made_document(2, "A", {made_tempco({0, 0, 0}, false)}),
      made_document(3, "B", {made_tempco({.4, .4, .4})})};
  EXPECT_EQ(only(documents).units_naming, 1U) << "one of two is not most";
}

// The sign of a line is its phase.
TEST(AdoptionRule, LinesAreTurnedToOneSide) {
  const auto line = [](int number, const char* unit, double sign) {
    EffectEvidence effect =
        made_effect("floor_vibration", "vector_mg", {sign * 1.0, sign * 0.5, sign * 0.2}, 0.01);
    effect.parameters.push_back({"frequency_hz", {12}, {0.01}});
    return made_document(number, unit, {effect});
  };
  const AdoptionDecision found = only({line(1, "A", 1), line(2, "B", -1), line(3, "C", 1.2)});
  EXPECT_EQ(found.outcome, AdoptionOutcome::adopted);
  EXPECT_GT(std::abs(found.parameters[0].numbers[0].mean), 1);
  EXPECT_NEAR(found.parameters[1].numbers[0].mean, 12, 1e-9);
}

TEST(AdoptionRule, TheOrderOfTheDocumentsDoesNotMatter) {
  std::vector<DocumentEvidence> documents = {made_document(1, "A", {made_tempco({.4, -.3, .2})}),
                                             made_document(2, "B", {made_tempco({.5, -.4, .3})}),
                                             made_document(3, "C", {made_tempco({.3, -.2, .1})})};
  const AdoptionDecision forward = only(documents);
  std::swap(documents[0], documents[2]);
  EXPECT_EQ(only(documents).parameters[0].numbers[0].mean, forward.parameters[0].numbers[0].mean);
}

TEST(AdoptionRule, EveryOutcomeHasANameAndASentence) {
  for (int i = 0; i < 9; ++i) {
    AdoptionDecision decision;
    decision.outcome = static_cast<AdoptionOutcome>(i);
    EXPECT_FALSE(to_string(decision.outcome).empty());
    EXPECT_EQ(decision.adopted(), decision.brief().starts_with("adopted"));
  }
}

}  // namespace
}  // namespace sixpoint::gap
