#include "gap/challenge/suggestion.h"

#include <algorithm>
#include <cmath>

#include "sim/standard_protocol.h"

namespace sixpoint::gap {
namespace {

double probability_in(const Outcome& outcome, const std::string& name) {
  const auto at = std::find_if(outcome.candidates.begin(), outcome.candidates.end(),
                               [&](const auto& candidate) { return candidate.first == name; });
  return at == outcome.candidates.end() ? 0 : at->second;
}

bool names(const Outcome& outcome, const std::string& name) {
  return std::any_of(outcome.named.begin(), outcome.named.end(),
                     [&](const auto& named) { return named.first == name; });
}

// Sums of one number over the effects of each trial.
class Clusters {
 public:
  void next_trial() { sums_.push_back({0, 0}); }
  void add(double value) {
    sums_.back()[0] += value;
    sums_.back()[1] += 1;
  }

  MeanOfEffects mean() const {
    double values = 0, count = 0, squares = 0;
    for (const auto& [value, n] : sums_) {
      values += value;
      count += n;
    }
    if (count == 0) {
      return {};
    }
    const double mean = values / count;
    for (const auto& [value, n] : sums_) {
      squares += (value - mean * n) * (value - mean * n);
    }
    const auto trials = static_cast<double>(sums_.size());
    const double sd = std::sqrt(squares * trials / std::max(1.0, trials - 1)) / count;
    return {mean, {mean - 1.96 * sd, mean + 1.96 * sd}};
  }

 private:
  std::vector<std::array<double, 2>> sums_;
};

}  // namespace

Status follow(sim::Scenario& scenario, const std::string& segment) {
  return sim::extend_run(*scenario.protocol, segment, scenario.seed);
}

Gain gain_of(const std::vector<Followed>& trials) {
  Gain gain;
  Clusters before, after, named, probability;
  for (const Followed& trial : trials) {
    if (trial.before.kind == TrialKind::outside || !trial.before.failure.empty()) {
      continue;
    }
    if (trial.before.suggestions.empty()) {
      gain.nothing_to_do += 1;
      continue;
    }
    if (!trial.after.failure.empty()) {
      continue;
    }
    const Suggestion& first = trial.before.suggestions.front();
    Gain::PerSegment& own = gain.by_segment[first.segment];
    gain.followed += 1;
    gain.minutes += first.minutes;
    gain.expected_nats += first.expected_nats;
    own.trials += 1;
    for (Clusters* clusters : {&before, &after, &named, &probability}) {
      clusters->next_trial();
    }
    for (const TrialEffect& effect : trial.before.truth) {
      const bool was = names(trial.before, effect.name);
      const bool is = names(trial.after, effect.name);
      const double p = probability_in(trial.before, effect.name);
      const double q = probability_in(trial.after, effect.name);
      gain.named_before.count(was);
      gain.named_after.count(is);
      own.before.count(was);
      own.after.count(is);
      before.add(p);
      after.add(q);
      named.add((is ? 1 : 0) - (was ? 1 : 0));
      probability.add(q - p);
    }
    for (const auto& [outcome, share] : {std::pair(&trial.before, &gain.false_before),
                                         std::pair(&trial.after, &gain.false_after)}) {
      for (const auto& [name, p] : outcome->named) {
        share->count(!outcome->has(name));
      }
    }
  }
  if (gain.followed > 0) {
    gain.minutes /= gain.followed;
    gain.expected_nats /= gain.followed;
  }
  gain.probability_before = before.mean();
  gain.probability_after = after.mean();
  gain.named_gain = named.mean();
  gain.probability_gain = probability.mean();
  return gain;
}

}  // namespace sixpoint::gap
