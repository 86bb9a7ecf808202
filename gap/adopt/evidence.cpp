#include "gap/adopt/evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "base/text/json_text.h"

namespace sixpoint::gap {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostEffects = 200;
constexpr std::size_t kMostNumbers = 9;
constexpr std::size_t kLongestName = 60;

tl::unexpected<Error> bad(const std::string& source, std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), source,
              "give the document that `sixpoint gap diagnose --json` writes, a bundle or a store");
}

// A number, three, or three rows of three. Empty where it is not that.
std::vector<double> numbers_of(const Json& json) {
  std::vector<double> numbers;
  for (const Json& row : json.is_array() ? json : Json::array({json})) {
    for (const Json& item : row.is_array() ? row : Json::array({row})) {
      if (!item.is_number() || numbers.size() == kMostNumbers ||
          !std::isfinite(item.get<double>())) {
        return {};
      }
      numbers.push_back(item.get<double>());
    }
  }
  return numbers;
}

// The same; 0 where a number has none (null).
std::vector<double> uncertainties_of(Json json) {
  for (Json& row : json) {
    if (row.is_null()) {
      row = 0;
    }
  }
  return numbers_of(json);
}

// What has a mean over units.
bool is_adopted(std::string_view effect, std::string_view parameter) {
  return !is_derived(effect, parameter) && parameter != "order";
}

// `finding`: an entry of effects or candidates.
EffectEvidence effect_of(const Json& finding) {
  EffectEvidence effect;
  effect.name = finding.at("name").get<std::string>().substr(0, kLongestName);
  effect.probability = finding.at("probability").is_number()
                           ? std::clamp(finding.at("probability").get<double>(), 0.0, 1.0)
                           : 0;
  effect.confounded = finding.contains("confounded_with") && !finding["confounded_with"].empty();
  const Json none = Json::object();
  const Json& sd =
      finding.contains("standard_uncertainty") ? finding["standard_uncertainty"] : none;
  const Json& form = finding.contains("form_uncertainty") ? finding["form_uncertainty"] : none;
  for (const auto& [name, value] : finding.at("parameters").items()) {
    NamedValue parameter{name, numbers_of(value), {}};
    if (parameter.value.empty() || !is_adopted(effect.name, name)) {
      continue;
    }
    if (sd.contains(name)) {
      parameter.sd = uncertainties_of(sd[name]);
      parameter.sd.resize(parameter.value.size(), 0);
    }
    if (form.contains(name)) {
      parameter.form_sd = uncertainties_of(form[name]);
      parameter.form_sd.resize(parameter.value.size(), 0);
    }
    effect.parameters.push_back(std::move(parameter));
  }
  return effect;
}

bool has_a_size(const EffectEvidence& effect) {
  return !effect.parameters.empty() && !effect.parameters.front().sd.empty() &&
         std::ranges::any_of(effect.parameters.front().sd, [](double sd) { return sd > 0; });
}

Json number_list(const std::vector<double>& numbers) {
  return numbers.size() == 1 ? Json(numbers.front()) : Json(numbers);
}

Json content_of(const DocumentEvidence& evidence) {
  Json json = {{"serial", evidence.serial},
               {"protocol", evidence.protocol},
               {"inconclusive", evidence.inconclusive},
               {"unknown", evidence.unknown},
               {"effects", Json::array()},
               {"not_observable", evidence.not_observable}};
  for (const EffectEvidence& effect : evidence.effects) {
    Json entry = {{"name", effect.name},
                  {"named", effect.named},
                  {"confounded", effect.confounded},
                  {"probability", effect.probability},
                  {"parameters", Json::object()},
                  {"standard_uncertainty", Json::object()}};
    for (const NamedValue& p : effect.parameters) {
      entry["parameters"][p.name] = number_list(p.value);
      if (!p.sd.empty()) {
        entry["standard_uncertainty"][p.name] = number_list(p.sd);
      }
      // Documents of earlier versions have none, and keep their digest.
      if (!p.form_sd.empty()) {
        entry["form_uncertainty"][p.name] = number_list(p.form_sd);
      }
    }
    json["effects"].push_back(std::move(entry));
  }
  return json;
}

// A document is itself also where a name in it is no UTF-8, as those of folders may be.
std::string digest_of(const DocumentEvidence& evidence) {
  return text_sha256(content_of(evidence).dump(-1, ' ', false, Json::error_handler_t::replace));
}

DocumentEvidence parse(const Json& json) {
  DocumentEvidence out;
  out.serial = json.at("serial").get<std::string>();
  // A table of readings names no unit: then it stands for one.
  if (out.serial.empty() && json.contains("bundle")) {
    const std::string name = json["bundle"].get<std::string>();
    out.serial = name.substr(name.find_last_of('/') + 1).substr(0, kLongestName);
  }
  out.protocol = json.at("protocol").get<std::string>();
  out.inconclusive = json.at("inconclusive").get<bool>();
  out.unknown = json.at("unknown").at("present").get<bool>();
  for (const Json& finding : json.at("effects")) {
    EffectEvidence effect = effect_of(finding);
    effect.named = !effect.confounded;
    out.effects.push_back(std::move(effect));
  }
  for (const Json& finding : json.at("candidates")) {
    EffectEvidence effect = effect_of(finding);
    const bool known = std::ranges::any_of(
        out.effects, [&](const EffectEvidence& other) { return other.name == effect.name; });
    if (!known && every_unit_has_some(effect.name) && has_a_size(effect)) {
      out.effects.push_back(std::move(effect));
    }
  }
  for (const Json& entry : json.at("not_observable")) {
    out.not_observable.push_back(entry.at("name").get<std::string>());
  }
  out.id = digest_of(out);
  return out;
}

Status check(const DocumentEvidence& evidence, const std::string& source) {
  if (evidence.serial.empty() || evidence.serial.size() > kLongestName) {
    return bad(source, "the diagnosis names no unit: its serial number is missing");
  }
  if (evidence.effects.size() > kMostEffects || evidence.not_observable.size() > kMostEffects) {
    return bad(source, "a diagnosis has not so many effects");
  }
  return {};
}

}  // namespace

bool every_unit_has_some(std::string_view effect) {
  constexpr std::array kAll = {
      "misalignment",  "non_orthogonality",  "second_order", "third_order", "hysteresis",
      "offset_tempco", "sensitivity_tempco", "warm_up",      "drift",       "tilt",
      "clock_error"};
  return std::ranges::find(kAll, effect) != kAll.end();
}

Result<DocumentEvidence> read_evidence(std::string_view text, const std::string& source) {
  const Json json = parse_json(text);
  if (!json.is_object() || json.value("schema", Json()) != "sixpoint/gap-diagnose/1") {
    return bad(source, "this is no diagnosis");
  }
  try {
    DocumentEvidence evidence = parse(json);
    evidence.source = source;
    SIXPOINT_CHECK(check(evidence, source));
    return evidence;
  } catch (const Json::exception& error) {
    return bad(source, fmt::format("the diagnosis is incomplete: {}", error.what()));
  }
}

DocumentEvidence evidence_of(const Diagnosis& diagnosis) {
  DocumentEvidence evidence = parse(diagnosis.to_json());
  evidence.source = diagnosis.bundle;
  return evidence;
}

Json to_json(const DocumentEvidence& evidence) {
  Json json = {
      {"sha256", evidence.id}, {"source", evidence.source}, {"adoption", evidence.adoption}};
  json.update(content_of(evidence));
  return json;
}

Result<DocumentEvidence> evidence_from_scenario(const Json& json) {
  const std::string where = "/population/documents";
  try {
    DocumentEvidence out;
    out.id = json.at("sha256").get<std::string>();
    out.source = json.at("source").get<std::string>();
    out.adoption = json.at("adoption").get<int>();
    out.serial = json.at("serial").get<std::string>();
    out.protocol = json.at("protocol").get<std::string>();
    out.inconclusive = json.at("inconclusive").get<bool>();
    out.unknown = json.at("unknown").get<bool>();
    out.not_observable = json.at("not_observable").get<std::vector<std::string>>();
    for (const Json& entry : json.at("effects")) {
      EffectEvidence effect = effect_of(entry);
      effect.named = entry.at("named").get<bool>();
      effect.confounded = entry.at("confounded").get<bool>();
      out.effects.push_back(std::move(effect));
    }
    SIXPOINT_CHECK(check(out, where));
    if (digest_of(out) != out.id) {
      return bad(where, fmt::format("the document of unit {} was changed by hand", out.serial));
    }
    return out;
  } catch (const Json::exception& error) {
    return bad(where, fmt::format("a document is incomplete: {}", error.what()));
  }
}

}  // namespace sixpoint::gap
