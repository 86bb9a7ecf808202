// Scores of a diagnosis of trials whose truth is known.
//
//   Outcome outcome = outcome_of(trial);
//   read_answer(answer_json, outcome);  // what `gap diagnose --json` said
//   const Scores scores = score({outcome}, false);
//   scores.first.of;  // trials of one effect
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "gap/challenge/trials.h"

namespace sixpoint::gap {

// A segment that the diagnosis suggests.
struct Suggestion {
  std::string segment;
  double minutes = 0;
  double expected_nats = 0;
};

// What came of one trial. Cases of the three judgements, each for trials without a failure:
//
// | the diagnosis                                            | honest | confidently wrong |
// |----------------------------------------------------------|--------|-------------------|
// | says unknown                                             | yes    | no                |
// | names an effect of the right family first                | yes    | no                |
// | names nothing, and the truth as not observable           | yes    | no                |
// | names another effect first, with more than 0.9           | no     | yes               |
// | all else                                                 | no     | no                |
struct Outcome {
  TrialKind kind = TrialKind::none;
  std::vector<TrialEffect> truth;
  std::string failure;  // of the program; empty where it answered
  std::string verdict;
  std::vector<std::pair<std::string, double>> named;       // accepted, strongest first
  std::vector<std::pair<std::string, double>> candidates;  // all, with probabilities
  std::set<std::string> confounded;                        // with the first one named
  std::set<std::string> not_observable;
  std::vector<Suggestion> suggestions;  // what to record next, best first
  bool unknown = false;
  double unknown_probability = 0;
  double seconds = 0;

  bool has(std::string_view name) const;  // the truth has this effect
  bool first_right() const { return !named.empty() && has(named.front().first); }
  bool family_right() const;
  bool honestly_blind() const;  // the protocol can't show it; said so, and nothing else named
  bool honest() const { return unknown || family_right() || honestly_blind(); }
  bool confidently_wrong() const;
};

Outcome outcome_of(const GapTrial& trial);

// Takes what is there and of the right type; an answer of another form counts as a failure.
void read_answer(const nlohmann::json& json, Outcome& outcome);

struct Share {
  double right = 0;
  double of = 0;
  void count(bool is_right) {
    right += is_right ? 1 : 0;
    of += 1;
  }
  std::array<double, 2> interval() const;  // Wilson (1927), 95 %
};

struct Scores {
  Share first;             // single: the first one named is right
  Share exact;             // single: it alone was named, and nothing called unknown
  Share first_observable;  // ... where the diagnosis does not say that this protocol can't show it
  Share first_large;       // ... and the severity is at least 1
  Share family;            // single: the family is right, where observable
  Share alarms;            // none: something was named or called unknown
  // realistic units, of the effects that the diagnosis does not list as not observable:
  Share dominant;         // the dominant effect is named first
  Share recall;           // effects that are named
  Share precise;          // named effects that are there
  Share exact_set;        // all of them are named, and nothing else
  Share needless;         // something is called unknown although the catalogue holds everything
  Share withheld_honest;  // outside or stripped: unknown, or the right family
  Share withheld_wrong;   // outside or stripped: confidently something else
  double pair_hits = 0, pair_named = 0, pair_truth = 0;
  Share failures;
  struct Bin {
    double sum_p = 0, right = 0, of = 0;
  };
  std::array<Bin, 10> bins;  // of the candidates' probabilities
  struct PerEffect {
    Share first, family;
    double blind = 0, missed = 0;
  };
  std::map<std::string, PerEffect> by_effect;
  // Of `unknown.probability`: whether the trial holds something outside the catalogue.
  std::array<Bin, 10> unknown_bins;
  double seconds_sum = 0, seconds_max = 0;

  double f1() const;                 // not a number without a trial of two effects
  double calibration_error() const;  // expected, over the bins
  double unknown_calibration_error() const;
};

// `strip`: the true effects were taken out of the catalogue.
Scores score(const std::vector<Outcome>& outcomes, bool strip);

}  // namespace sixpoint::gap
