// What the segment that the diagnosis suggests first is worth: the same unit again, with it.
//
//   Followed trial{outcome_of(drawn), outcome_of(drawn)};
//   SIXPOINT_CHECK(follow(drawn.scenario, "yaw"));  // the same unit, with one segment more
//   read_answer(answer_json, trial.after);
//   const Gain gain = gain_of({trial});
//   gain.named_after.right;  // effects that are there and named with the segment
//
// Only trials whose effects the catalogue holds count, and only those with a suggestion: the others
// have nothing to follow.
#pragma once

#include <array>
#include <vector>

#include "base/result.h"
#include "gap/challenge/score.h"

namespace sixpoint::gap {

// The same unit, seed and segments, and this one after them.
Status follow(sim::Scenario& scenario, const std::string& segment);

struct Followed {
  Outcome before;
  Outcome after;  // with the segment that `before` suggests first
};

// A mean over effects that come in trials, and its 95 % interval: a ratio estimator with the trials
// as clusters (Cochran 1977, Sampling Techniques, 6.4).
struct MeanOfEffects {
  double mean = 0;
  std::array<double, 2> interval{};
};

struct Gain {
  double followed = 0;              // trials with a suggestion
  double nothing_to_do = 0;         // trials without one
  double minutes = 0;               // of the segments, mean
  double expected_nats = 0;         // mean
  Share named_before, named_after;  // of the effects that are there
  MeanOfEffects probability_before, probability_after;
  MeanOfEffects named_gain, probability_gain;  // after less before, of the same effects
  Share false_before, false_after;             // names of what is not there
  struct PerSegment {
    Share before, after;  // effects that are there and named
    double trials = 0;
  };
  std::map<std::string, PerSegment> by_segment;
};

Gain gain_of(const std::vector<Followed>& trials);

}  // namespace sixpoint::gap
