#include "gap/judge/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json values(const std::vector<double>& list) {
  if (list.size() == 1) {
    return finite(list.front());
  }
  Json json = Json::array();
  if (list.size() == 9) {
    for (std::size_t row = 0; row < 3; ++row) {
      json.push_back(Json::array(
          {finite(list[3 * row]), finite(list[3 * row + 1]), finite(list[3 * row + 2])}));
    }
    return json;
  }
  for (const double value : list) {
    json.push_back(finite(value));
  }
  return json;
}

}  // namespace

std::vector<NamedValue> EffectFinding::all_parameters() const {
  std::vector<NamedValue> all = parameters;
  for (const std::vector<NamedValue>& line : further_lines) {
    all.insert(all.end(), line.begin(), line.end());
  }
  return all;
}

std::vector<std::string> uncertainty_texts(const NamedValue& parameter) {
  std::vector<std::string> texts;
  for (const double sd : parameter.sd) {
    texts.push_back(std::isnan(sd) ? "-" : fmt::format("{:.2g}", sd));
  }
  return texts;
}

namespace {

void add_parameters(const std::vector<NamedValue>& parameters, Json& json) {
  json["parameters"] = Json::object();
  json["standard_uncertainty"] = Json::object();
  json["form_uncertainty"] = Json::object();
  for (const NamedValue& parameter : parameters) {
    json["parameters"][parameter.name] = values(parameter.value);
    if (!parameter.sd.empty()) {
      std::vector<double> sd = parameter.sd;
      std::ranges::replace_if(
          sd, [](double x) { return std::isnan(x); }, 0.0);
      json["standard_uncertainty"][parameter.name] = values(sd);
    }
    if (!parameter.form_sd.empty()) {
      json["form_uncertainty"][parameter.name] = values(parameter.form_sd);
    }
  }
}

// Numbers that other generators' labels have under another name or in another unit. Answers have
// both, so that labels and answers can be compared by name.
struct SecondName {
  std::string_view effect, first, second;
  double factor;
};
constexpr std::array<SecondName, 2> kSecondNames = {
    {{"sensitivity_tempco", "percent_per_c", "relative_per_c", 0.01},
     {"soft_mount", "frequency_hz", "f0_hz", 1}}};

std::vector<NamedValue> with_second_names(const EffectFinding& finding) {
  std::vector<NamedValue> parameters = finding.parameters;
  for (const NamedValue& parameter : finding.parameters) {
    for (const SecondName& n : kSecondNames) {
      if (finding.name == n.effect && parameter.name == n.first) {
        NamedValue second = parameter;
        second.name = n.second;
        for (std::vector<double>* numbers : {&second.value, &second.sd, &second.form_sd}) {
          std::ranges::for_each(*numbers, [&](double& x) { x *= n.factor; });
        }
        parameters.push_back(std::move(second));
      }
    }
  }
  return parameters;
}

Json finding_json(const EffectFinding& finding) {
  Json json;
  json["name"] = finding.name;
  json["probability"] = finite(finding.probability);
  json["evidence_nats"] = finite(finding.nats);
  add_parameters(with_second_names(finding), json);
  if (!finding.further_lines.empty()) {
    json["further_lines"] = Json::array();
    for (const std::vector<NamedValue>& line : finding.further_lines) {
      add_parameters(line, json["further_lines"].emplace_back());
    }
  }
  json["held_out_gain_nats"] = finite(finding.held_out_gain_nats);
  json["share_of_gap"] = finite(finding.share_of_gap);
  json["probability_it_matters"] = finite(finding.probability_it_matters);
  json["bound"] = finding.bound ? finite(*finding.bound) : Json(nullptr);
  json["learnt_from_units"] = finding.learnt_from_units;
  json["outside_datasheet"] = finding.outside_datasheet;
  json["confounded_with"] = finding.confounded_with;
  return json;
}

Json findings_json(const std::vector<EffectFinding>& findings) {
  Json json = Json::array();
  for (const EffectFinding& finding : findings) {
    json.push_back(finding_json(finding));
  }
  return json;
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  constexpr std::array<std::string_view, 4> kNames = {"no_gap", "explained", "partly_explained",
                                                      "unexplained"};
  return kNames[static_cast<std::size_t>(verdict)];
}

std::string Diagnosis::brief() const {
  if (inconclusive) {
    return fmt::format("nothing can be said: {}",
                       losses.empty() ? "too little data" : losses.back());
  }
  const auto named = [this](const std::string& name) {
    return std::ranges::any_of(effects, [&](const EffectFinding& e) { return e.name == name; });
  };
  std::string names;
  std::set<std::string> open;
  for (const EffectFinding& effect : effects) {
    std::vector<std::string> instead;
    for (const std::string& other : effect.confounded_with) {
      if (named(other)) {
        open.insert({effect.name, other});
      } else {
        instead.push_back(other);
      }
    }
    names += (names.empty() ? "" : " and ") + effect.name;
    names += instead.empty() ? "" : fmt::format(" (or {})", fmt::join(instead, ", "));
  }
  if (!open.empty()) {
    names += fmt::format(" (how much each of {} has is open)", fmt::join(open, ", "));
  }
  const bool plural = effects.size() > 1;
  const CatalogueEntry* first = effects.empty() ? nullptr : find_entry(effects.front().name);
  const std::string advice = first == nullptr ? "" : fmt::format("; {}", first->advice);
  switch (verdict) {
    case Verdict::no_gap:
      return fmt::format(
          "no gap: the nominal simulator explains the recording ({:.2f} mg, noise and seating "
          "leave {:.2f} mg)",
          gap.before_mg, gap.floor_mg);
    case Verdict::explained:
      if (first != nullptr && effects.size() == 1 && gap.closed_fraction == 0 &&
          (first->name == "seating" || first->name == "random_walk" || first->name == "flicker")) {
        return fmt::format(
            "{} explains the gap of {:.2f} mg, which is irreducible: it can't be predicted for "
            "what "
            "was not yet measured{}",
            names, gap.before_mg, advice);
      }
      return fmt::format("{} explain{} the gap: {:.2f} mg -> {:.2f} mg (floor {:.2f} mg){}", names,
                         plural ? "" : "s", gap.before_mg, gap.after_mg, gap.floor_mg, advice);
    case Verdict::partly_explained:
      if (gap.after_mg >= gap.before_mg) {
        return fmt::format(
            "{} {} there and {} not explain the gap ({:.2f} mg): something unknown is left: {}",
            names, plural ? "are" : "is", plural ? "do" : "does", gap.before_mg,
            unknown.why.empty() ? "" : unknown.why.front());
      }
      return fmt::format(
          "{} explain{} a part of the gap ({:.2f} mg -> {:.2f} mg), and something unknown is left: "
          "{}",
          names, plural ? "" : "s", gap.before_mg, gap.after_mg,
          unknown.why.empty() ? "" : unknown.why.front());
    case Verdict::unexplained:
      return fmt::format("there is a gap that nothing in the catalogue explains: {}",
                         unknown.why.empty() ? "" : unknown.why.front());
  }
  return "";
}

bool is_derived(std::string_view effect, std::string_view parameter) {
  return (effect == "tilt" && parameter == "angle_deg") ||
         (effect == "flicker" && parameter == "floor_mg") ||
         std::ranges::any_of(kSecondNames, [&](const SecondName& n) {
           return effect == n.effect && parameter == n.second;
         });
}

Json augmented_scenario(const Diagnosis& diagnosis) {
  if (diagnosis.protocol == kNoProtocol) {
    return nullptr;
  }
  Json json = {{"schema", "sixpoint/scenario/1"},
               {"seed", diagnosis.seed},
               {"protocol", diagnosis.protocol == "production" ? "production" : "engineering"},
               {"unit",
                {{"serial", diagnosis.serial},
                 {"gain", diagnosis.unit.gain},
                 {"offset_g", diagnosis.unit.offset_g},
                 {"noise_mg", diagnosis.unit.noise_mg}}},
               {"effects", Json::array()}};
  const auto add = [&](const std::string& effect, const std::vector<NamedValue>& parameters) {
    Json entry;
    entry["name"] = effect;
    entry["parameters"] = Json::object();
    for (const NamedValue& parameter : parameters) {
      if (!is_derived(effect, parameter.name)) {
        entry["parameters"][parameter.name] = values(parameter.value);
      }
    }
    json["effects"].push_back(std::move(entry));
  };
  for (const EffectFinding& effect : diagnosis.effects) {
    add(effect.name, effect.parameters);
    for (const std::vector<NamedValue>& line : effect.further_lines) {
      add(effect.name, line);
    }
  }
  return json;
}

Json Diagnosis::to_json() const {
  Json places = Json::array();
  for (const UnknownPlace& place : unknown.where) {
    places.push_back({{"axis", std::string(1, "XYZ"[place.axis])},
                      {"segment", place.segment},
                      {"factor", place.factor}});
  }
  Json json = {{"bundle", bundle},
               {"serial", serial},
               {"firmware", firmware},
               {"protocol", protocol},
               {"verdict", to_string(verdict)},
               {"inconclusive", inconclusive},
               {"brief", brief()},
               {"effects", findings_json(effects)},
               {"candidates", findings_json(candidates)},
               {"unknown",
                {{"present", unknown.present},
                 {"probability", finite(unknown.probability)},
                 {"size_mg", finite(unknown.size_mg)},
                 {"where", std::move(places)},
                 {"why", unknown.why}}}};
  json["not_observable"] = Json::array();
  for (const auto& [name, segment] : not_observable) {
    const auto judged =
        std::find_if(candidates.begin(), candidates.end(),
                     [&wanted = name](const EffectFinding& f) { return f.name == wanted; });
    const bool known = judged != candidates.end() && judged->bound;
    json["not_observable"].push_back({{"name", name},
                                      {"needs_segment", segment},
                                      {"bound", known ? finite(*judged->bound) : Json(nullptr)}});
  }
  json["gap"]["before"] = {{"rms_mg", finite(gap.before_mg)}, {"sigma", finite(gap.before_sigma)}};
  json["gap"]["after"] = {
      {"rms_mg", finite(gap.after_mg)},
      {"sigma", finite(gap.after_sigma)},
      {"interval_mg", {finite(gap.after_interval_mg[0]), finite(gap.after_interval_mg[1])}}};
  json["gap"]["floor_mg"] = finite(gap.floor_mg);
  json["gap"]["closed_fraction"] = finite(gap.closed_fraction);
  for (std::size_t i = 0; i < kFeatureNames.size(); ++i) {
    json["gap"]["by_feature"][kFeatureNames[i]] = {{"before_sigma", finite(gap.by_feature[i][0])},
                                                   {"after_sigma", finite(gap.by_feature[i][1])}};
  }
  json["where"] = Json::array();
  for (const Location& location : where) {
    json["where"].push_back({{"axis", std::string(1, "XYZ"[location.axis])},
                             {"segment", location.segment},
                             {"factor", location.factor},
                             {"residual_mg", finite(location.residual_mg)},
                             {"sigma", finite(location.sigma)}});
  }
  json["next_segments"] = Json::array();
  for (const NextSegment& next : next_segments) {
    json["next_segments"].push_back({{"name", next.name},
                                     {"minutes", next.minutes},
                                     {"expected_nats", finite(next.expected_nats)},
                                     {"separates", next.separates}});
  }
  json["augmented_scenario"] = augmented_scenario(*this);
  json["unit"] = {{"gain", unit.gain}, {"offset_g", unit.offset_g}, {"noise_mg", unit.noise_mg}};
  json["losses"] = losses;
  json["seconds"] = finite(seconds);
  return json;
}

}  // namespace sixpoint::gap
