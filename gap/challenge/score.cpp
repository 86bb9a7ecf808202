#include "gap/challenge/score.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sixpoint::gap {
namespace {

using Json = nlohmann::json;
using Named = std::vector<std::pair<std::string, double>>;

// Names and probabilities of a list of the answer.
Named list_of(const Json& json, const char* key) {
  Named found;
  if (const auto effects = json.find(key); effects != json.end() && effects->is_array()) {
    for (const Json& effect : *effects) {
      if (effect.is_object() && effect.contains("name") && effect["name"].is_string()) {
        const auto p = effect.find("probability");
        found.emplace_back(effect["name"].get<std::string>(),
                           p != effect.end() && p->is_number() ? p->get<double>() : 0.0);
      }
    }
  }
  return found;
}

std::vector<Suggestion> suggestions_of(const Json& json) {
  std::vector<Suggestion> list;
  const auto next = json.find("next_segments");
  if (next == json.end() || !next->is_array()) {
    return list;
  }
  const auto number_of = [](const Json& entry, const char* key) {
    const auto value = entry.find(key);
    return value != entry.end() && value->is_number() ? value->get<double>() : 0.0;
  };
  for (const Json& entry : *next) {
    if (entry.is_object() && entry.contains("name") && entry["name"].is_string()) {
      list.push_back({entry["name"].get<std::string>(), number_of(entry, "minutes"),
                      number_of(entry, "expected_nats")});
    }
  }
  return list;
}

void score_single(const Outcome& outcome, Scores& scores) {
  const TrialEffect& truth = outcome.truth.front();
  scores.first.count(outcome.first_right());
  scores.exact.count(outcome.first_right() && outcome.named.size() == 1 && !outcome.unknown);
  auto& effect = scores.by_effect[truth.name];
  effect.blind += outcome.honestly_blind() ? 1 : 0;
  if (outcome.not_observable.contains(truth.name)) {
    return;
  }
  scores.first_observable.count(outcome.first_right());
  scores.family.count(outcome.family_right());
  effect.first.count(outcome.first_right());
  effect.family.count(outcome.family_right());
  effect.missed += outcome.named.empty() && !outcome.unknown ? 1 : 0;
  if (truth.severity >= 1) {
    scores.first_large.count(outcome.first_right());
  }
}

void score_pair(const Outcome& outcome, Scores& scores) {
  for (const auto& [name, probability] : outcome.named) {
    scores.pair_hits += outcome.has(name) ? 1 : 0;
    scores.pair_named += 1;
  }
  for (const TrialEffect& effect : outcome.truth) {
    scores.pair_truth += outcome.not_observable.contains(effect.name) ? 0 : 1;
  }
}

void score_realistic(const Outcome& outcome, Scores& scores) {
  const TrialEffect& dominant = outcome.truth.front();
  if (!outcome.not_observable.contains(dominant.name)) {
    scores.dominant.count(!outcome.named.empty() && outcome.named.front().first == dominant.name);
  }
  bool all = true;
  for (const TrialEffect& effect : outcome.truth) {
    const bool named = std::any_of(outcome.named.begin(), outcome.named.end(),
                                   [&](const auto& n) { return n.first == effect.name; });
    if (!outcome.not_observable.contains(effect.name)) {
      scores.recall.count(named);
      auto& own = scores.by_effect[effect.name];
      own.first.count(named);
      own.missed += named ? 0 : 1;
      all = all && named;
    }
  }
  for (const auto& [name, probability] : outcome.named) {
    scores.precise.count(outcome.has(name));
    all = all && outcome.has(name);
  }
  scores.exact_set.count(all && !outcome.unknown);
  scores.needless.count(outcome.unknown);
}

Scores::Bin& bin_of(std::array<Scores::Bin, 10>& bins, double probability) {
  return bins[static_cast<std::size_t>(std::clamp(probability * 10, 0.0, 9.0))];
}

double expected_error(const std::array<Scores::Bin, 10>& bins) {
  double error = 0;
  double all = 0;
  for (const Scores::Bin& bin : bins) {
    error += std::abs(bin.sum_p - bin.right);
    all += bin.of;
  }
  return all == 0 ? 0 : error / all;
}

}  // namespace

bool Outcome::has(std::string_view name) const {
  return std::any_of(truth.begin(), truth.end(),
                     [&](const TrialEffect& effect) { return effect.name == name; });
}

bool Outcome::family_right() const {
  return !named.empty() &&
         (std::any_of(truth.begin(), truth.end(),
                      [&](const TrialEffect& effect) {
                        return family_of(effect.name) == family_of(named.front().first);
                      }) ||
          std::any_of(confounded.begin(), confounded.end(),
                      [&](const std::string& name) { return has(name); }));
}

bool Outcome::honestly_blind() const {
  return named.empty() && !truth.empty() &&
         std::all_of(truth.begin(), truth.end(), [&](const TrialEffect& effect) {
           return not_observable.contains(effect.name);
         });
}

bool Outcome::confidently_wrong() const {
  constexpr double kConfident = 0.9;  // convention
  return !unknown && !named.empty() && named.front().second > kConfident && !family_right();
}

Outcome outcome_of(const GapTrial& trial) {
  Outcome outcome;
  outcome.kind = trial.kind;
  outcome.truth = trial.effects;
  return outcome;
}

void read_answer(const Json& json, Outcome& outcome) {
  if (!json.is_object() || !json.contains("verdict") || !json["verdict"].is_string()) {
    outcome.failure = "no answer of the agreed form";
    return;
  }
  outcome.verdict = json["verdict"].get<std::string>();
  outcome.named = list_of(json, "effects");
  outcome.candidates = list_of(json, "candidates");
  for (const auto& [name, probability] : list_of(json, "not_observable")) {
    outcome.not_observable.insert(name);
  }
  outcome.suggestions = suggestions_of(json);
  if (!outcome.named.empty()) {
    const Json& first = json["effects"][0];
    if (const auto other = first.find("confounded_with");
        other != first.end() && other->is_array()) {
      for (const Json& name : *other) {
        if (name.is_string()) {
          outcome.confounded.insert(name.get<std::string>());
        }
      }
    }
  }
  if (const auto unknown = json.find("unknown"); unknown != json.end() && unknown->is_object()) {
    const auto present = unknown->find("present");
    const auto probability = unknown->find("probability");
    outcome.unknown_probability =
        probability != unknown->end() && probability->is_number() ? probability->get<double>() : 0;
    outcome.unknown = present != unknown->end() && present->is_boolean() && present->get<bool>();
  }
}

std::array<double, 2> Share::interval() const {
  constexpr double kZ = 1.96;
  if (of == 0) {
    return {0, 1};
  }
  const double p = right / of;
  const double denominator = 1 + kZ * kZ / of;
  const double centre = (p + kZ * kZ / (2 * of)) / denominator;
  const double half = kZ * std::sqrt(p * (1 - p) / of + kZ * kZ / (4 * of * of)) / denominator;
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

double Scores::f1() const {
  return pair_named + pair_truth == 0 ? std::numeric_limits<double>::quiet_NaN()
                                      : 2 * pair_hits / (pair_named + pair_truth);
}

double Scores::calibration_error() const { return expected_error(bins); }
double Scores::unknown_calibration_error() const { return expected_error(unknown_bins); }

Scores score(const std::vector<Outcome>& outcomes, bool strip) {
  Scores scores;
  for (const Outcome& outcome : outcomes) {
    scores.failures.count(!outcome.failure.empty());
    if (!outcome.failure.empty()) {
      continue;
    }
    scores.seconds_sum += outcome.seconds;
    scores.seconds_max = std::max(scores.seconds_max, outcome.seconds);
    const bool withheld =
        outcome.kind == TrialKind::outside || (strip && outcome.kind != TrialKind::none);
    Scores::Bin& unknown = bin_of(scores.unknown_bins, outcome.unknown_probability);
    unknown.sum_p += outcome.unknown_probability;
    unknown.right += withheld ? 1 : 0;
    unknown.of += 1;
    if (withheld) {
      scores.withheld_honest.count(outcome.honest());
      scores.withheld_wrong.count(outcome.confidently_wrong());
      continue;
    }
    for (const auto& [name, probability] : outcome.candidates) {
      Scores::Bin& bin = bin_of(scores.bins, probability);
      bin.sum_p += probability;
      bin.right += outcome.has(name) ? 1 : 0;
      bin.of += 1;
    }
    if (outcome.kind == TrialKind::none) {
      scores.alarms.count(!outcome.named.empty() || outcome.unknown);
    } else if (outcome.kind == TrialKind::single) {
      score_single(outcome, scores);
    } else if (outcome.kind == TrialKind::realistic) {
      score_realistic(outcome, scores);
    } else {
      score_pair(outcome, scores);
    }
  }
  return scores;
}

}  // namespace sixpoint::gap
