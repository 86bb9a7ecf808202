#include "gap/adopt/progress.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/counted.h"

namespace sixpoint::gap {

namespace {

using Json = nlohmann::ordered_json;

double square(double x) { return x * x; }

Json fraction_json(const Closed& closed) {
  return closed.fraction ? Json(*closed.fraction) : Json(nullptr);
}

ProgressSum sum_of(const std::vector<const BundleProgress*>& bundles, std::size_t adoptions) {
  ProgressSum sum;
  sum.bundles = bundles.size();
  sum.after_mg.assign(adoptions, 0);
  if (bundles.empty()) {
    return sum;
  }
  const auto n = static_cast<double>(bundles.size());
  for (const BundleProgress* bundle : bundles) {
    sum.before_mg += square(bundle->before_mg) / n;
    sum.floor_mg += square(bundle->floor_mg) / n;
    for (std::size_t i = 0; i < adoptions; ++i) {
      sum.after_mg[i] += square(bundle->after_mg[i]) / n;
    }
  }
  sum.before_mg = std::sqrt(sum.before_mg);
  sum.floor_mg = std::sqrt(sum.floor_mg);
  for (double& mg : sum.after_mg) {
    mg = std::sqrt(mg);
  }
  if (!sum.after_mg.empty()) {
    sum.closed = closed_of(sum.before_mg, sum.after_mg.back(), sum.before_mg, sum.floor_mg);
  }
  return sum;
}

Json sum_json(const ProgressSum& sum) {
  if (sum.bundles == 0) {
    return {{"bundles", 0}};
  }
  return {{"bundles", sum.bundles},
          {"before_mg", sum.before_mg},
          {"after_mg", sum.after_mg},
          {"floor_mg", sum.floor_mg},
          {"closed_fraction", fraction_json(sum.closed)}};
}

}  // namespace

std::string Closed::text() const {
  if (fraction) {
    return fmt::format("{:.1f} %", 100 * *fraction);
  }
  return wider_mg > 0 ? fmt::format("wider by {:.2f} mg", wider_mg) : "next to nothing was open";
}

Closed closed_of(double from_mg, double to_mg, double before_mg, double floor_mg) {
  constexpr double kChance = 1.5;
  if (to_mg > from_mg) {
    return {std::nullopt, to_mg - from_mg};
  }
  if (!(before_mg > kChance * floor_mg)) {
    return {};
  }
  const double open = square(before_mg) - square(floor_mg);
  // What is left below the floor is chance: no more than all is closed.
  return {std::min(1.0, (square(from_mg) - square(to_mg)) / open), 0};
}

ProgressRecorder::ProgressRecorder(ScenarioHistory history)
    : learnt_from_(std::move(history.documents)) {
  progress_.history = std::move(history.states);
  if (!progress_.history.empty()) {
    for (const sim::EffectSpec& effect : sim::mean_effects(progress_.history.back().population)) {
      progress_.effects.push_back({effect.kind->name, is_scatter(effect.kind->name), 0, {}});
    }
  }
  without_mg_.resize(progress_.effects.size());
}

Status ProgressRecorder::add(const std::string& name, const RecordedBundle& recorded) {
  if (!recorded.diagnosis.usable()) {
    progress_.losses.push_back(fmt::format("{}: {}", name, recorded.diagnosis.brief()));
    return {};
  }
  BundleProgress bundle;
  bundle.name = name;
  bundle.serial = recorded.diagnosis.serial;
  bundle.learnt_from = learnt_from_.contains(evidence_of(recorded.diagnosis).id);
  bundle.unknown = recorded.diagnosis.unknown.present;
  SIXPOINT_ASSIGN(const BundleGap before, gap_with(recorded, {}));
  bundle.before_mg = before.gap_mg;
  bundle.floor_mg = before.floor_mg;
  for (const PopulationState& state : progress_.history) {
    SIXPOINT_ASSIGN(const BundleGap after, gap_with(recorded, sim::mean_effects(state.population)));
    bundle.after_mg.push_back(after.gap_mg);
  }
  for (std::size_t i = 0; i < progress_.effects.size(); ++i) {
    double without_mg = bundle.after_mg.back();
    if (!progress_.effects[i].scatter) {
      std::vector<sim::EffectSpec> others = sim::mean_effects(progress_.history.back().population);
      std::erase_if(others, [&](const sim::EffectSpec& effect) {
        return effect.kind->name == progress_.effects[i].name;
      });
      SIXPOINT_ASSIGN(const BundleGap left, gap_with(recorded, others));
      without_mg = left.gap_mg;
    }
    without_mg_[i].push_back(without_mg);
  }
  progress_.bundles.push_back(std::move(bundle));
  return {};
}

GapProgress ProgressRecorder::finish() const {
  GapProgress out = progress_;
  std::vector<const BundleProgress*> all;
  std::vector<const BundleProgress*> new_ones;
  for (const BundleProgress& bundle : out.bundles) {
    all.push_back(&bundle);
    if (!bundle.learnt_from) {
      new_ones.push_back(&bundle);
    }
  }
  out.all = sum_of(all, out.history.size());
  out.new_ones = sum_of(new_ones, out.history.size());
  for (std::size_t i = 0; i < out.effects.size() && !all.empty(); ++i) {
    double mean = 0;
    for (const double mg : without_mg_[i]) {
      mean += square(mg) / static_cast<double>(without_mg_[i].size());
    }
    EffectProgress& effect = out.effects[i];
    effect.without_mg = std::sqrt(mean);
    effect.closed =
        closed_of(effect.without_mg, out.all.after_mg.back(), out.all.before_mg, out.all.floor_mg);
  }
  std::ranges::stable_sort(out.effects, std::greater<>(), &EffectProgress::without_mg);
  return out;
}

std::string GapProgress::brief() const {
  if (bundles.empty()) {
    return "there is no recording to compare with";
  }
  if (history.empty()) {
    return fmt::format("the scenario has learnt nothing yet: {:.2f} mg (floor {:.2f} mg)",
                       all.before_mg, all.floor_mg);
  }
  const ProgressSum& sum = new_ones.bundles > 0 ? new_ones : all;
  return fmt::format(
      "{}{}: {:.2f} mg before, {:.2f} mg after {} (floor "
      "{:.2f} mg): {}{}",
      counted(sum.bundles, "recording"),
      new_ones.bundles > 0 ? " from which the scenario did not learn"
                           : " from which the scenario learnt",
      sum.before_mg, sum.after_mg.back(), counted(history.size(), "adoption"), sum.floor_mg,
      sum.closed.text(), sum.closed.fraction ? " closed" : "");
}

Json GapProgress::to_json() const {
  Json json = {{"brief", brief()}, {"adoptions", Json::array()}, {"bundles", Json::array()}};
  for (const PopulationState& state : history) {
    Json names = Json::array();
    for (const sim::PopulationEffect& effect : state.population) {
      names.push_back(effect.kind->name);
    }
    json["adoptions"].push_back({{"number", state.adoption},
                                 {"made_at", state.made_at},
                                 {"documents", state.documents},
                                 {"effects", std::move(names)}});
  }
  for (const BundleProgress& bundle : bundles) {
    json["bundles"].push_back({{"name", bundle.name},
                               {"serial", bundle.serial},
                               {"learnt_from", bundle.learnt_from},
                               {"unknown", bundle.unknown},
                               {"before_mg", bundle.before_mg},
                               {"after_mg", bundle.after_mg},
                               {"floor_mg", bundle.floor_mg}});
  }
  json["all"] = sum_json(all);
  json["new"] = sum_json(new_ones);
  json["effects"] = Json::array();
  for (const EffectProgress& effect : effects) {
    json["effects"].push_back({{"name", effect.name},
                               {"scatter", effect.scatter},
                               {"without_mg", effect.without_mg},
                               {"closed_fraction", fraction_json(effect.closed)}});
  }
  json["losses"] = losses;
  return json;
}

}  // namespace sixpoint::gap
