#include "gap/benchmark/labels.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "base/text/json_text.h"
#include "gap/benchmark/json_lines.h"
#include "gap/benchmark/shown.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSchema = "sixpoint/gap-labels/1";
constexpr std::uint64_t kNameStream = 0x6E616D65;
constexpr double kVisibleSeverity = 10;
constexpr double kLargestClock = 0.4;  // beyond that the phase of a fast tone is lost

// Parameters that an effect's size is proportional to.
constexpr std::array<std::string_view, 12> kSizes = {
    "vector_mg", "mg",        "rotation_vector_deg", "amplitude", "mg_per_h",      "sd_deg",
    "yz_xz_xy",  "mg_per_g2", "mg_per_g3",           "mg_per_c",  "percent_per_c", "mg_per_sqrt_s"};

// By how much the parts of one effect are enlarged before they are simulated; they are.
double enlarge(std::vector<sim::EffectSpec>& parts, double severity) {
  const bool clock = parts.front().kind->name == "clock_error";
  const double factor = std::max(1.0, (clock ? kLargestClock : kVisibleSeverity) / severity);
  bool enlarged = false;
  for (sim::EffectSpec& part : parts) {
    for (auto& [name, values] : part.values) {
      const bool size = clock ? name == "ppm" : std::ranges::find(kSizes, name) != kSizes.end();
      for (double& value : values) {
        value *= size ? factor : 1;
      }
      enlarged = enlarged || size;
    }
  }
  return enlarged ? factor : 1;
}

Error bad_label(std::size_t line, std::string_view what) {
  return Error{ErrorCode::bad_data, std::string(what), fmt::format("line {} of the labels", line),
               "take the file that gap challenge --export wrote"};
}

Result<LabelledEffect> parse_effect(const Json& json, std::size_t line) {
  LabelledEffect effect;
  const auto text = [&](const char* key, std::string& value) {
    const bool there = json.is_object() && json.contains(key) && json[key].is_string();
    value = there ? json[key].get<std::string>() : "";
    return !value.empty();
  };
  const auto size = [&](const char* key, double& value) {
    const bool there = json.is_object() && json.contains(key) && json[key].is_number();
    value = there ? json[key].get<double>() : -1;
    return std::isfinite(value) && value >= 0;
  };
  if (!text("name", effect.name) || !text("family", effect.family) ||
      !size("severity", effect.severity) || !size("size_over_bound", effect.size_over_bound)) {
    return tl::unexpected(
        bad_label(line, "an effect needs name, family, severity and size_over_bound"));
  }
  return effect;
}

Result<TrialLabel> parse_label(const Json& json, std::size_t line) {
  TrialLabel label;
  if (!json.is_object() || !json.contains("bundle") || !json["bundle"].is_string() ||
      !json.contains("kind") || !json["kind"].is_string() || !json.contains("effects") ||
      !json["effects"].is_array() || !json.contains("where") || !json["where"].is_array()) {
    return tl::unexpected(bad_label(line, "a label needs bundle, kind, effects and where"));
  }
  label.bundle = json["bundle"].get<std::string>();
  constexpr std::array kKinds = {TrialKind::none, TrialKind::single, TrialKind::pair,
                                 TrialKind::outside, TrialKind::realistic};
  const auto kind = std::ranges::find(kKinds, json["kind"].get<std::string>(),
                                      [](TrialKind k) { return std::string(to_string(k)); });
  if (kind == kKinds.end()) {
    return tl::unexpected(bad_label(line, "there is no such kind of trial"));
  }
  label.kind = *kind;
  for (const Json& effect : json["effects"]) {
    SIXPOINT_ASSIGN(LabelledEffect parsed, parse_effect(effect, line));
    label.effects.push_back(std::move(parsed));
  }
  if (label.effects.empty() != (label.kind == TrialKind::none)) {
    return tl::unexpected(bad_label(line, "kind and effects contradict each other"));
  }
  for (const Json& place : json["where"]) {
    const bool whole = place.is_object() && place.contains("axis") && place["axis"].is_string() &&
                       place.contains("segment") && place["segment"].is_string();
    const int axis = whole ? axis_of(place["axis"].get<std::string>()) : -1;
    if (axis < 0) {
      return tl::unexpected(bad_label(line, "a place needs axis (X, Y, Z) and segment"));
    }
    label.where.emplace(axis, place["segment"].get<std::string>());
  }
  return label;
}

}  // namespace

int axis_of(std::string_view name) {
  return name == "X" ? 0 : name == "Y" ? 1 : name == "Z" ? 2 : -1;
}

std::string axis_name(int axis) { return std::string(1, "XYZ"[axis]); }

Result<TrialLabel> label_of(const GapTrial& trial, const std::string& bundle) {
  TrialLabel label;
  label.bundle = bundle;
  label.kind = trial.kind;
  if (trial.effects.empty()) {
    return label;
  }
  sim::ProtocolRun nominal = *trial.scenario.protocol;
  const std::vector<sim::EffectSpec> all = std::move(nominal.effects);
  nominal.effects.clear();
  SIXPOINT_ASSIGN(const sim::ProtocolRecord without, sim::record_protocol(nominal));
  sim::ProtocolRun faulty = nominal;
  auto next = all.begin();
  for (const TrialEffect& effect : trial.effects) {
    const auto end = next + static_cast<std::ptrdiff_t>(effect.parts);
    faulty.effects.assign(next, end);
    next = end;
    const double factor =
        trial.kind == TrialKind::outside ? 1 : enlarge(faulty.effects, effect.severity);
    SIXPOINT_ASSIGN(const sim::ProtocolRecord with, sim::record_protocol(faulty));
    const Shown shown = what_is_shown(nominal, without, with);
    label.effects.push_back({effect.name, std::string(family_of(effect.name)), effect.severity,
                             shown.index() / kShownAt / factor});
    if (trial.kind == TrialKind::outside) {
      for (const auto& [place, square] : shown.by_place) {
        if (square >= kShownAt * kShownAt) {
          label.where.insert(place);
        }
      }
    }
  }
  return label;
}

std::string bundle_name(std::uint64_t seed, std::uint64_t index) {
  Random random(seed + 0x9E3779B97F4A7C15ULL * (index + 1), kNameStream);
  return fmt::format("b{:016x}", random.bits());
}

std::string labels_text(const Labels& labels) {
  Json head;
  head["schema"] = kSchema;
  head["seed"] = labels.seed;
  head["protocol"] = labels.protocol;
  head["bundles"] = labels.trials.size();
  std::string text = head.dump() + "\n";
  for (const TrialLabel& label : labels.trials) {
    Json line;
    line["bundle"] = label.bundle;
    line["kind"] = to_string(label.kind);
    line["effects"] = Json::array();
    for (const LabelledEffect& effect : label.effects) {
      line["effects"].push_back({{"name", effect.name},
                                 {"family", effect.family},
                                 {"severity", effect.severity},
                                 {"size_over_bound", effect.size_over_bound}});
    }
    line["where"] = Json::array();
    for (const auto& [axis, segment] : label.where) {
      line["where"].push_back({{"axis", axis_name(axis)}, {"segment", segment}});
    }
    text += line.dump() + "\n";
  }
  return text;
}

Result<Labels> parse_labels(std::string_view text) {
  Labels labels;
  std::set<std::string> names;
  for (const auto& [line, row] : rows_of(text)) {
    const Json json = parse_json(row);
    if (line == 1) {
      if (!json.is_object() || json.value("schema", Json()) != kSchema) {
        return tl::unexpected(bad_label(line, fmt::format("this is no file of {}", kSchema)));
      }
      const auto& seed = json.value("seed", Json());
      const auto& protocol = json.value("protocol", Json());
      labels.seed = seed.is_number_unsigned() ? seed.get<std::uint64_t>() : 0;
      labels.protocol = protocol.is_string() ? protocol.get<std::string>() : "";
      continue;
    }
    SIXPOINT_ASSIGN(TrialLabel label, parse_label(json, line));
    if (!names.insert(label.bundle).second) {
      return tl::unexpected(bad_label(line, "the bundle has two labels"));
    }
    labels.trials.push_back(std::move(label));
  }
  if (labels.trials.empty()) {
    return tl::unexpected(bad_label(1, "there are no labels"));
  }
  std::ranges::sort(labels.trials, {}, &TrialLabel::bundle);
  return labels;
}

}  // namespace sixpoint::gap
