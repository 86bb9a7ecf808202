#include "station/limits/verdict.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;

Limits with(const char* toml) { return *parse_limits(toml, "t.toml"); }

// Oracle: ILAC-G8:09/2019, Figure 4: w = U on both sides of both limits, edges included as its
// inequalities have them (accept at most at TL - w, reject above TL + w).
TEST(Verdict, FourAnswersByTheGuardBand) {
  const Limits limits = with("[zero_offset_mg]\nlow = -100\nhigh = 200\n");
  const auto verdict = [&](double value) {
    return judge_quantity({"zero_offset_mg", "x", value, 5}, limits).verdict;  // U = 10
  };
  EXPECT_EQ(verdict(0), JigVerdict::pass);
  EXPECT_EQ(verdict(190), JigVerdict::pass);
  EXPECT_EQ(verdict(190.1), JigVerdict::conditional_pass);
  EXPECT_EQ(verdict(200), JigVerdict::conditional_pass);
  EXPECT_EQ(verdict(200.1), JigVerdict::conditional_fail);
  EXPECT_EQ(verdict(209.9), JigVerdict::conditional_fail);
  EXPECT_EQ(verdict(210), JigVerdict::fail);
  EXPECT_EQ(verdict(-90), JigVerdict::pass);
  EXPECT_EQ(verdict(-90.1), JigVerdict::conditional_pass);
  EXPECT_EQ(verdict(-100.1), JigVerdict::conditional_fail);
  EXPECT_EQ(verdict(-111), JigVerdict::fail);
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", -111, 5}, limits).code, "zero_low");
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 211, 5}, limits).code, "zero_high");
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 0, 5}, limits).code, "");
}

TEST(Verdict, TheLimitsOwnGuardBandHoldsWhereItIsWider) {
  const Limits limits = with("[zero_offset_mg]\nhigh = 200\nguard_band = 30\n");
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 175, 5}, limits).verdict,
            JigVerdict::conditional_pass);
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 165, 20}, limits).verdict,
            JigVerdict::conditional_pass)
      << "U = 40 is wider";
}

// docs/verdicts.md: an uncertainty that leaves nothing to pass makes a quantity inconclusive, every
// quantity of the table and whatever the decision rule; only what is beyond its limit by U fails.
// Oracle: the definition, value by value over the whole range of each quantity.
TEST(Verdict, AnUncertaintyLargerThanItsLimitIsInconclusiveForEveryQuantity) {
  for (const char* rule : {"", "[decision]\nguard_factor = 0\n"}) {
    const Limits limits = with(rule);
    for (const QuantityInfo& info : quantities()) {
      if (info.name.find("_uncertainty_") != std::string_view::npos) {
        continue;  // judged without an uncertainty of their own
      }
      const Limit& limit = limits.of(info.name);
      ASSERT_TRUE(limit.high) << info.name;
      const double low = limit.low.value_or(info.least);
      const double room = limit.low ? (*limit.high - low) / 2 : *limit.high - low;
      const auto judged = [&](double value, double expanded) {
        return judge_quantity({std::string(info.name), "", value, expanded / 2}, limits);
      };
      for (int step = 0; step <= 100; ++step) {
        const double value = low + 0.01 * step * (*limit.high - low);
        const auto coarse = judged(value, 1.01 * room);
        EXPECT_EQ(coarse.verdict, JigVerdict::inconclusive) << info.name << ' ' << value;
        EXPECT_EQ(coarse.code, "uncertainty_high");
        EXPECT_NE(judged(value, 0.99 * room).verdict, JigVerdict::inconclusive) << info.name;
      }
      EXPECT_EQ(judged(limit.low ? low + room : low, 0.99 * room).verdict, JigVerdict::pass)
          << info.name << ": one value may still pass";
      EXPECT_EQ(judged(*limit.high + 0.9 * room, 1.01 * room).verdict, JigVerdict::inconclusive);
      EXPECT_EQ(judged(*limit.high + 1.1 * room, 1.01 * room).verdict, JigVerdict::fail)
          << info.name << ": that is beyond it, however coarse";
    }
  }
  const Verdict verdict = judge_quantities({{"noise_mg", "x", 5, 6}}, default_limits());
  EXPECT_EQ(verdict.verdict, JigVerdict::inconclusive);
  EXPECT_THAT(verdict.codes, testing::ElementsAre("uncertainty_high"));
  EXPECT_THAT(verdict.reasons[0],
              HasSubstr("the expanded uncertainty of 12 mg leaves nothing inside 10 mg"));
}

TEST(Verdict, WithoutAGuardBandThereIsNothingConditional) {
  const Limits limits = with("[decision]\nguard_factor = 0\n[zero_offset_mg]\nhigh = 200\n");
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 200, 5}, limits).verdict, JigVerdict::pass);
  EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 200.1, 5}, limits).verdict, JigVerdict::fail);
}

TEST(Verdict, NoNumberIsNoVerdict) {
  for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", value, 5}, default_limits()).verdict,
              JigVerdict::inconclusive);
    EXPECT_EQ(judge_quantity({"zero_offset_mg", "x", 0, value}, default_limits()).verdict,
              JigVerdict::inconclusive);
  }
}

TEST(Verdict, SaysWhyNothingCanBeSaid) {
  const auto reason = [](const Measured& measured) {
    return judge_quantities({measured}, default_limits()).reasons.at(0);
  };
  EXPECT_EQ(reason({"zero_offset_mg", "x", std::nan(""), 5}), "Zero offset, x: no number");
  EXPECT_EQ(reason({"zero_offset_mg", "x", 0, std::nan("")}), "Zero offset, x: no number");
  EXPECT_EQ(reason({"zero_uncertainty_mg", "", std::nan(""), 0}),
            "Expanded uncertainty of zero offset: no number");
  EXPECT_EQ(
      judge_quantities({{"zero_offset_mg", "x", 0, 600}}, default_limits()).brief(),
      "inconclusive; Zero offset, x: the expanded uncertainty of 1200 mg leaves nothing inside "
      "-700 mg to 700 mg; measured too coarsely to judge the unit");
}

// What a run of another day, or a hand, may have left in a store: only what is a quantity is taken,
// and nothing in it passes that does not say so.
TEST(Verdict, QuantitiesAreReadBackFromWhatIsStored) {
  const Limits limits = default_limits();
  auto stored = nlohmann::ordered_json::array();
  const std::vector<JudgedQuantity> judged = {
      judge_quantity({"zero_offset_mg", "x", 12, 1}, limits),
      judge_quantity({"noise_mg", "y", 20, 0.1}, limits),
      judge_quantity({"noise_mg", "z", std::nan(""), 0.1}, limits)};
  for (const JudgedQuantity& quantity : judged) {
    stored.push_back(to_json(quantity));
  }
  const auto back = quantities_from_json(stored);
  ASSERT_EQ(back.size(), judged.size());
  for (std::size_t i = 0; i < back.size(); ++i) {
    EXPECT_EQ(to_json(back[i]), to_json(judged[i])) << i;
  }
  EXPECT_EQ(back[1].low, std::nullopt);
  EXPECT_TRUE(std::isnan(back[2].value));

  EXPECT_TRUE(quantities_from_json(nlohmann::ordered_json::object()).empty());
  const auto odd = quantities_from_json(nlohmann::ordered_json::parse(
      R"(["noise_mg", {}, {"name": 7}, {"name": "weight_kg"},
          {"name": "noise_mg", "axis": 1, "value": "4", "low": true, "verdict": "passed", "code": []}])"));
  ASSERT_EQ(odd.size(), 1U);
  EXPECT_EQ(odd[0].axis, "");
  EXPECT_TRUE(std::isnan(odd[0].value));
  EXPECT_EQ(odd[0].low, std::nullopt);
  EXPECT_EQ(odd[0].verdict, JigVerdict::inconclusive);
  EXPECT_EQ(odd[0].code, "");
}

TEST(Verdict, TheWorstIsTheWhole) {
  const Limits limits = default_limits();
  const Measured good{"noise_mg", "x", 4, 0.1};
  const Measured near{"noise_mg", "y", 9.9, 0.1};
  const Measured coarse{"zero_uncertainty_mg", "x", 30, 0};
  const Measured beyond{"noise_mg", "z", 10.1, 0.1};
  const Measured far{"zero_offset_mg", "z", 900, 1};
  const auto of = [&](const std::vector<Measured>& all) {
    return judge_quantities(all, limits).verdict;
  };
  EXPECT_EQ(of({}), JigVerdict::inconclusive) << "what was not measured did not pass";
  EXPECT_EQ(of({good}), JigVerdict::pass);
  EXPECT_EQ(of({good, near}), JigVerdict::conditional_pass);
  EXPECT_EQ(of({near, coarse}), JigVerdict::inconclusive);
  EXPECT_EQ(of({coarse, beyond}), JigVerdict::conditional_fail);
  EXPECT_EQ(of({beyond, far, near}), JigVerdict::fail);
  const Verdict all = judge_quantities({near, beyond, coarse, far, good}, limits);
  EXPECT_THAT(all.codes, testing::ElementsAre("zero_high", "noise_high", "uncertainty_high"));
  EXPECT_EQ(all.reasons.size(), 4U);
  EXPECT_THAT(all.reasons[0], HasSubstr("Zero offset, z: 900 mg is above 700 mg"));
  EXPECT_THAT(all.reasons[2], HasSubstr("measured too coarsely"));
}

TEST(FailureCodes, EveryCodeThatCanComeIsInTheCatalogueOnce) {
  std::set<std::string_view> seen;
  for (const FailureCode& code : failure_codes()) {
    EXPECT_TRUE(seen.insert(code.code).second) << code.code;
    EXPECT_FALSE(code.meaning.empty()) << code.code;
    EXPECT_FALSE(code.cause.empty()) << code.code;
    EXPECT_FALSE(code.next_action.empty()) << code.code;
  }
  for (const QuantityInfo& info : quantities()) {
    for (const std::string_view code : {info.code_low, info.code_high}) {
      EXPECT_TRUE(code.empty() || find_failure_code(code) != nullptr) << code;
    }
  }
}

// docs/verdicts.md is the catalogue for people: the same codes in the same words, none more, none
// fewer.
TEST(FailureCodes, TheDocumentHasEveryCodeAndNoOther) {
  std::ifstream file(SIXPOINT_SOURCE "/docs/verdicts.md");
  ASSERT_TRUE(file);
  const std::string head = "| code | what | probable cause | what to do |";
  std::vector<std::string> rows;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    inside = line == head || (inside && line.starts_with("|"));
    if (inside && line.starts_with("| `")) {
      rows.push_back(line);
    }
  }
  std::vector<std::string> wanted;
  for (const FailureCode& code : failure_codes()) {
    wanted.push_back(fmt::format("| `{}` | {} | {} | {} |", code.code, code.meaning, code.cause,
                                 code.next_action));
  }
  EXPECT_THAT(rows, testing::ElementsAreArray(wanted));
}

TEST(FailureCodes, WhatToDoIsSaidOnceEach) {
  EXPECT_THAT(next_actions({"temperature_low", "noise_high", "temperature_high", "no_such_code"}),
              testing::ElementsAre("Leave it on the bench for an hour and repeat.",
                                   "Stop what shakes the bench, seat the unit anew and repeat."));
  EXPECT_TRUE(next_actions({}).empty());
  EXPECT_THAT(next_actions({"sensitivity_low"}),
              testing::ElementsAre(HasSubstr("Repeat the run once")));
  EXPECT_THAT(next_actions({"sensitivity_low", "noise_high"}, true),
              testing::ElementsAre(testing::AllOf(HasSubstr("Keep the unit back"),
                                                  HasSubstr("retest SERIAL --release"))));
}

TEST(Verdict, NamesAreReadBack) {
  for (const auto verdict :
       {JigVerdict::pass, JigVerdict::conditional_pass, JigVerdict::conditional_fail,
        JigVerdict::fail, JigVerdict::inconclusive, JigVerdict::stopped}) {
    EXPECT_EQ(parse_jig_verdict(to_string(verdict)), verdict);
  }
  EXPECT_EQ(parse_jig_verdict("passed"), std::nullopt);
}

// --- retest policy ---

EarlierRun ended(JigVerdict verdict) { return {"id", verdict, {}, false}; }

TEST(Retest, AUnitThatFailedNeedsTwoPassesInARow) {
  const RetestPolicy policy;
  EXPECT_EQ(retest_state({}, policy).passes_needed, 1);
  EXPECT_EQ(retest_state({}, policy).retest_of, "");
  std::vector<EarlierRun> runs = {ended(JigVerdict::fail)};
  EXPECT_EQ(retest_state(runs, policy).passes_needed, 2);
  EXPECT_EQ(retest_state(runs, policy).retest_of, "id");
  runs.push_back(ended(JigVerdict::conditional_pass));
  EXPECT_EQ(retest_state(runs, policy).passes_needed, 1);
  EXPECT_EQ(retest_state(runs, policy).retest_of, "id");
  runs.push_back(ended(JigVerdict::pass));
  EXPECT_EQ(retest_state(runs, policy).retest_of, "") << "it counts as passed";
  runs = {ended(JigVerdict::fail), ended(JigVerdict::pass), ended(JigVerdict::conditional_fail)};
  EXPECT_EQ(retest_state(runs, policy).passes_needed, 2) << "not in a row";

  Verdict verdict;
  verdict.verdict = JigVerdict::pass;
  apply_retest(verdict, retest_state(runs, policy));
  EXPECT_EQ(verdict.verdict, JigVerdict::conditional_pass);
  EXPECT_THAT(verdict.codes, Contains("retest"));
  verdict.verdict = JigVerdict::fail;
  verdict.codes.clear();
  apply_retest(verdict, retest_state(runs, policy));
  EXPECT_EQ(verdict.verdict, JigVerdict::fail);
  EXPECT_TRUE(verdict.codes.empty());
}

// "Repeat the run once" behind it, and the next run was refused.
TEST(Retest, TheThirdFailureInARowIsTheLastOne) {
  const RetestPolicy policy;
  std::vector<EarlierRun> runs = {ended(JigVerdict::fail)};
  EXPECT_FALSE(is_last_failure(JigVerdict::fail, retest_state(runs, policy))) << "the second";
  runs.push_back(ended(JigVerdict::fail));
  EXPECT_TRUE(is_last_failure(JigVerdict::fail, retest_state(runs, policy)));
  EXPECT_TRUE(is_last_failure(JigVerdict::conditional_fail, retest_state(runs, policy)));
  EXPECT_FALSE(is_last_failure(JigVerdict::inconclusive, retest_state(runs, policy)));
  EXPECT_FALSE(is_last_failure(JigVerdict::conditional_pass, retest_state(runs, policy)));
  runs.back().released_after = true;
  EXPECT_FALSE(is_last_failure(JigVerdict::fail, retest_state(runs, policy)));
  EXPECT_FALSE(is_last_failure(JigVerdict::fail, RetestState{})) << "a check unit";
}

TEST(Retest, AfterThreeFailuresInARowAnEngineerDecides) {
  const RetestPolicy policy;
  std::vector<EarlierRun> runs = {ended(JigVerdict::fail), ended(JigVerdict::inconclusive),
                                  ended(JigVerdict::fail), ended(JigVerdict::stopped)};
  EXPECT_TRUE(retest_state(runs, policy).may_start) << "what says nothing does not count";
  runs.push_back(ended(JigVerdict::conditional_fail));
  EXPECT_FALSE(retest_state(runs, policy).may_start);
  EXPECT_THAT(retest_state(runs, policy).reason, HasSubstr("3 times"));
  runs.back().released_after = true;
  EXPECT_TRUE(retest_state(runs, policy).may_start);
  EXPECT_EQ(retest_state(runs, policy).passes_needed, 2) << "released is not passed";
  runs.push_back(ended(JigVerdict::fail));
  EXPECT_TRUE(retest_state(runs, policy).may_start) << "counted from the release";
}

}  // namespace
}  // namespace sixpoint::station
