#include "gap/benchmark/benchmark_score.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gap/benchmark/measures.h"

namespace sixpoint::gap {
namespace {

// One bundle, its answer, and what the header's tables make of them.
struct Judged {
  const TrialLabel* label = nullptr;
  const Answer* answer = nullptr;  // none: missing
  Outcome outcome;
  double openness = 1;    // unknown.probability
  double confidence = 0;  // in the answer's class
  bool right = false;
  std::size_t hits = 0, must = 0, must_named = 0;

  bool known() const { return label->kind != TrialKind::outside; }
  bool has_effects() const { return known() && label->kind != TrialKind::none; }
  std::size_t names() const { return outcome.named.size(); }
};

bool is_named(const Outcome& outcome, const std::string& effect) {
  return std::ranges::any_of(outcome.named, [&](const auto& n) { return n.first == effect; });
}

bool is_right(const Judged& judged) {
  const Outcome& outcome = judged.outcome;
  switch (judged.label->kind) {
    case TrialKind::none:
      return judged.answer != nullptr && outcome.named.empty();
    case TrialKind::realistic:
      return !outcome.named.empty() &&
             outcome.named.front().first == judged.label->effects.front().name;
    case TrialKind::outside:
      return outcome.family_right();
    case TrialKind::single:
    case TrialKind::pair:
      break;
  }
  const bool silent = judged.answer != nullptr && outcome.named.empty();
  return outcome.first_right() || (silent && judged.must == 0);
}

Judged judge(const TrialLabel& label, const Answer* answer) {
  Judged judged;
  judged.label = &label;
  judged.answer = answer;
  Outcome& outcome = judged.outcome;
  outcome.kind = label.kind;
  for (const LabelledEffect& effect : label.effects) {
    outcome.truth.push_back({effect.name, effect.severity});
    if (!effect.must()) {
      outcome.not_observable.insert(effect.name);
    }
  }
  outcome.unknown = true;
  if (answer != nullptr) {
    outcome.named = answer->effects;
    outcome.candidates = answer->candidates;
    outcome.unknown = answer->unknown;
    outcome.unknown_probability = answer->unknown_probability;
    judged.openness = answer->unknown_probability;
    double most = 0;
    for (const auto& [name, probability] : answer->candidates) {
      most = std::max(most, probability);
    }
    judged.confidence = (1 - judged.openness) *
                        (answer->effects.empty() ? 1 - most : answer->effects.front().second);
  }
  for (const auto& [name, probability] : outcome.named) {
    judged.hits += outcome.has(name) ? 1 : 0;
  }
  for (const LabelledEffect& effect : label.effects) {
    judged.must += effect.must() ? 1 : 0;
    judged.must_named += effect.must() && is_named(outcome, effect.name) ? 1 : 0;
  }
  judged.right = is_right(judged);
  return judged;
}

using Drawn = std::span<const std::size_t>;

class Scorer {
 public:
  Scorer(std::vector<Judged> all, const BenchmarkOptions& options)
      : all_(std::move(all)), options_(options) {}

  void add_measures(std::vector<Measure>& measures) const {
    std::vector<Outcome> outcomes;
    for (const Judged& judged : all_) {
      outcomes.push_back(judged.outcome);
    }
    const Scores scores = score(outcomes, false);
    Share exact, needless;
    for (const Judged& judged : all_) {
      if (judged.has_effects()) {
        exact.count(judged.must_named == judged.must && judged.hits == judged.names() &&
                    !judged.outcome.unknown);
        needless.count(judged.outcome.unknown);
      }
    }
    const auto open = [](const Judged& judged) { return -judged.openness; };
    const auto sure = [](const Judged& judged) { return judged.confidence; };
    const auto any = [](const Judged& judged) { return judged.known(); };
    const auto real = [](const Judged& judged) {
      return judged.label->kind == TrialKind::realistic;
    };
    measures = {
        drawn(
            "open_auc", [&](Drawn d) { return pairs(d, any, open); }, count(any)),
        drawn(
            "open_auc_realistic", [&](Drawn d) { return pairs(d, real, open); }, count(real)),
        drawn(
            "oscr", [&](Drawn d) { return pairs(d, any, sure); }, count(any)),
        drawn(
            "augrc", [this](Drawn d) { return risk(d); }, static_cast<double>(all_.size())),
        drawn(
            "top_label_calibration", [this](Drawn d) { return names(d, true); }, count_named()),
        drawn(
            "names_calibration", [this](Drawn d) { return names(d, false); }, count_named()),
        drawn(
            "unknown_calibration", [this](Drawn d) { return unknowns(d); }, count_given()),
        drawn(
            "recall", [this](Drawn d) { return sets(d).recall(); }, sets().must),
        drawn(
            "precision", [this](Drawn d) { return sets(d).precision(); }, sets().named),
        drawn(
            "f1", [this](Drawn d) { return sets(d).f1(); }, sets().truth),
        share("exact_set", exact),
        share("first_right", scores.first_observable),
        share("dominant_first", scores.dominant),
        share("needless_unknown", needless),
        share("alarms", scores.alarms),
        share("outside_honest", scores.withheld_honest),
        share("outside_confidently_wrong", scores.withheld_wrong),
        drawn(
            "localisation_f1", [this](Drawn d) { return places(d).f1(); }, places().truth),
        drawn(
            "half_named_at", [this](Drawn d) { return half_named_at(sized(d)); },
            static_cast<double>(sized(everything()).size()))};
  }

  std::vector<PowerStep> power() const {
    std::vector<PowerStep> steps;
    double low = 0;
    for (const double high : {0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 8.0, 1e300}) {
      steps.push_back({low, high, {}});
      low = high;
    }
    for (const Sized& effect : sized(everything())) {
      const auto step = std::ranges::find_if(
          steps, [&](const PowerStep& s) { return effect.size >= s.low && effect.size < s.high; });
      if (step != steps.end()) {
        step->named.count(effect.named);
      }
    }
    return steps;
  }

 private:
  // Of sets of names, or of places.
  struct Counts {
    double hits = 0, named = 0, truth = 0, must = 0, must_named = 0;
    double recall() const { return must > 0 ? must_named / must : kNotDefined; }
    double precision() const { return named > 0 ? hits / named : kNotDefined; }
    double f1() const { return named + truth > 0 ? 2 * hits / (named + truth) : kNotDefined; }
  };

  std::vector<std::size_t> everything() const {
    std::vector<std::size_t> numbers(all_.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      numbers[i] = i;
    }
    return numbers;
  }

  template <class Is>
  double count(Is is) const {
    return static_cast<double>(std::ranges::count_if(all_, is));
  }
  double count_given() const {
    return count([](const Judged& judged) { return judged.answer != nullptr; });
  }
  double count_named() const {
    return count([](const Judged& judged) { return judged.names() > 0; });
  }

  template <class Is, class Confidence>
  double pairs(Drawn drawn, Is is_known, Confidence confidence) const {
    std::vector<Ranked> known;
    std::vector<double> unknown;
    for (const std::size_t i : drawn) {
      if (!all_[i].known()) {
        unknown.push_back(confidence(all_[i]));
      } else if (is_known(all_[i])) {
        known.push_back({confidence(all_[i]), all_[i].right});
      }
    }
    return right_above(known, unknown);
  }

  double risk(Drawn drawn) const {
    std::vector<Ranked> answers;
    for (const std::size_t i : drawn) {
      answers.push_back({all_[i].confidence, all_[i].right});
    }
    return area_under_risk_coverage(answers);
  }

  double names(Drawn drawn, bool labels_apart) const {
    std::vector<Said> said;
    for (const std::size_t i : drawn) {
      const Judged& judged = all_[i];
      if (judged.names() > 0) {
        const auto& [name, probability] = judged.outcome.named.front();
        said.push_back(
            {labels_apart ? name : "", probability,
             judged.known() ? judged.outcome.first_right() : judged.outcome.family_right()});
      }
    }
    return calibration_error(said);
  }

  double unknowns(Drawn drawn) const {
    std::vector<Said> said;
    for (const std::size_t i : drawn) {
      if (all_[i].answer != nullptr) {
        said.push_back({"", all_[i].openness, !all_[i].known()});
      }
    }
    return calibration_error(said);
  }

  Counts sets() const { return sets(everything()); }
  Counts sets(Drawn drawn) const {
    Counts counts;
    for (const std::size_t i : drawn) {
      const Judged& judged = all_[i];
      if (judged.known()) {
        counts.hits += static_cast<double>(judged.hits);
        counts.named += static_cast<double>(judged.names());
        counts.must += static_cast<double>(judged.must);
        counts.must_named += static_cast<double>(judged.must_named);
        counts.truth += static_cast<double>(judged.must - judged.must_named + judged.hits);
      }
    }
    return counts;
  }

  Counts places() const { return places(everything()); }
  Counts places(Drawn drawn) const {
    Counts counts;
    for (const std::size_t i : drawn) {
      const Judged& judged = all_[i];
      if (!judged.known() && !judged.label->where.empty() && judged.answer != nullptr &&
          judged.answer->unknown && judged.answer->where) {
        for (const Place& place : *judged.answer->where) {
          counts.hits += judged.label->where.contains(place) ? 1 : 0;
        }
        counts.named += static_cast<double>(judged.answer->where->size());
        counts.truth += static_cast<double>(judged.label->where.size());
      }
    }
    return counts;
  }

  std::vector<Sized> sized(Drawn drawn) const {
    std::vector<Sized> effects;
    for (const std::size_t i : drawn) {
      if (all_[i].known()) {
        for (const LabelledEffect& effect : all_[i].label->effects) {
          effects.push_back({effect.size_over_bound, is_named(all_[i].outcome, effect.name)});
        }
      }
    }
    return effects;
  }

  Measure drawn(const char* name, const Statistic& statistic, double of) const {
    return {name, statistic(everything()),
            bootstrap_interval(all_.size(), statistic, options_.seed, options_.draws), "bootstrap",
            of};
  }

  static Measure share(const char* name, const Share& share) {
    return {name, share.of > 0 ? share.right / share.of : kNotDefined, share.interval(), "wilson",
            share.of};
  }

  std::vector<Judged> all_;
  BenchmarkOptions options_;
};

}  // namespace

const Measure& BenchmarkScores::at(std::string_view name) const {
  return *std::ranges::find(measures, name, &Measure::name);
}

Result<BenchmarkScores> score_answers(const Labels& labels, const std::vector<Answer>& answers,
                                      const BenchmarkOptions& options) {
  std::map<std::string_view, const Answer*> by_bundle;
  for (const Answer& answer : answers) {
    if (!std::ranges::binary_search(labels.trials, answer.bundle, {}, &TrialLabel::bundle)) {
      return fail(ErrorCode::bad_data, "there is an answer to a bundle that has no label",
                  answer.bundle.substr(0, 40), "the answers belong to another challenge");
    }
    by_bundle[answer.bundle] = &answer;
  }
  BenchmarkScores scores;
  std::vector<Judged> all;
  for (const TrialLabel& label : labels.trials) {
    const auto found = by_bundle.find(label.bundle);
    all.push_back(judge(label, found == by_bundle.end() ? nullptr : found->second));
    scores.missing += found == by_bundle.end() ? 1 : 0;
    scores.kinds[std::string(to_string(label.kind))] += 1;
  }
  scores.bundles = all.size();
  const Scorer scorer(std::move(all), options);
  scorer.add_measures(scores.measures);
  scores.power = scorer.power();
  return scores;
}

}  // namespace sixpoint::gap
