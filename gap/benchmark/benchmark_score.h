// Scores of a program's answers against sealed labels, each with an interval.
//
//   SIXPOINT_ASSIGN(const BenchmarkScores scores, score_answers(labels, answers));
//   for (const Measure& measure : scores.measures) {
//     // 95 % intervals: Wilson's for shares of bundles, else bootstrap over bundles
//     std::cout << measure.name << ": " << measure.value << '\n';
//   }
//   scores.missing;  // bundles without an answer: they count as abstaining
//
// A bundle is known where the catalogue holds all that is in it (kinds none, single, pair,
// realistic), else it is outside. What an answer says of a bundle:
//
//     the answer       its class        its confidence
//     names effects    the first one    p = the first one's probability
//     names none       nothing          p = 1 - the largest probability of `candidates`
//     is missing       nothing          p = 0, and unknown.probability 1: it abstains
//
// and its confidence is p (1 - unknown.probability). Right is
//
//     the bundle     right
//     none           the class `nothing`
//     single, pair   an effect that is there, or the class `nothing` where none must be named
//     realistic      the dominant effect
//     outside        the right family (labels.h), where the kind has one
//
// The measures, in the order of BenchmarkScores::measures; score.h and measures.h have formulas and
// sources:
//     open_auc                 known right, with a lower unknown.probability than what is outside
//     open_auc_realistic       the same of the realistic bundles alone
//     oscr                     the same by confidence
//     augrc                    generalised risk over coverage, all bundles; less is better
//     top_label_calibration    first-named effects, labels apart; less is better
//     names_calibration        the same, all labels together
//     unknown_calibration      of unknown.probability; less is better
//     recall                   effects of known bundles that must be named (twice the bound): named
//     precision                names on known bundles that are right
//     f1                       2 hits / (names + effects that must be named or are): known bundles
//     exact_set                known bundles with an effect: all that must be, no other, no unknown
//     first_right              single: the first name is right, where it must be named
//     dominant_first           realistic: the dominant effect is named first
//     needless_unknown         known bundles with an effect: something is called unknown; less is
//                              better
//     alarms                   kind none: anything is named or called unknown; less is better
//     outside_honest           outside: unknown, right family, or below twice the bound and silent
//     outside_confidently_wrong  outside: score.h; less is better
//     localisation_f1          (axis, segment), outside bundles that show, answers that say where
//     half_named_at            size over the bound at which half are named; less is better
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/result.h"
#include "gap/benchmark/answers.h"
#include "gap/benchmark/labels.h"
#include "gap/challenge/score.h"

namespace sixpoint::gap {

struct Measure {
  std::string name;
  double value = 0;  // NaN where there is nothing to measure
  std::array<double, 2> interval{};
  const char* interval_by = "";  // "wilson" or "bootstrap"
  double of = 0;                 // bundles, effects, names or places that it is a measure of
};

// Effects of the catalogue with sizes over the bound in [low, high).
struct PowerStep {
  double low = 0, high = 0;
  Share named;
};

struct BenchmarkScores {
  std::size_t bundles = 0;
  std::size_t missing = 0;
  std::map<std::string, std::size_t> kinds;
  std::vector<Measure> measures;
  std::vector<PowerStep> power;
  // The measure of that name; it must be one of the list above.
  const Measure& at(std::string_view name) const;
};

struct BenchmarkOptions {
  std::uint64_t seed = 1;    // of the bootstrap
  std::size_t draws = 1000;  // enough for ends of 95 % to a tenth of their distance
};

// bad_data where an answer is for a bundle that has no label. Deterministic.
Result<BenchmarkScores> score_answers(const Labels& labels, const std::vector<Answer>& answers,
                                      const BenchmarkOptions& options = {});

}  // namespace sixpoint::gap
