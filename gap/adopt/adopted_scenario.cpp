#include "gap/adopt/adopted_scenario.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "sim/scenario.h"

namespace sixpoint::gap {

namespace {

using Json = nlohmann::ordered_json;

Json list_or_number(const std::vector<double>& numbers) {
  return numbers.size() == 1 ? Json(numbers.front()) : Json(numbers);
}

Json effect_json(const AdoptionDecision& decision) {
  Json json = {{"name", decision.name},
               {"share_of_units", decision.share_of_units},
               {"mean", Json::object()},
               {"spread", Json::object()},
               {"standard_uncertainty", Json::object()},
               {"units", decision.units()},
               {"bundles", decision.bundles}};
  for (const AdoptedNumber& parameter : decision.parameters) {
    std::vector<double> mean;
    std::vector<double> spread;
    std::vector<double> uncertainty;
    for (const MeanAndSpread& number : parameter.numbers) {
      mean.push_back(number.mean);
      uncertainty.push_back(number.standard_uncertainty);
      if (number.spread) {
        spread.push_back(*number.spread);
      }
    }
    json["mean"][parameter.parameter] = list_or_number(mean);
    json["spread"][parameter.parameter] =
        spread.size() == mean.size() ? list_or_number(spread) : Json(nullptr);
    json["standard_uncertainty"][parameter.parameter] = list_or_number(uncertainty);
  }
  return json;
}

// What a scenario holds of earlier adoptions, and what people wrote into it.
struct Earlier {
  Json scenario;
  Json adoptions = Json::array();
  std::vector<DocumentEvidence> documents;
  std::map<std::string, Json> population;  // by name
  std::set<std::string> adopted;           // of those, by the last adoption
  std::set<std::string> own;               // stand in `effects`, or were written by hand
};

Result<Earlier> read_earlier(std::string_view text) {
  // Strict, with the path of what is wrong.
  SIXPOINT_CHECK(sim::parse_scenario(text));
  const auto wrong = [](const std::string& what) {
    return fail(ErrorCode::configuration, what, "scenario: /population",
                "docs/scenario.md describes every key");
  };
  Earlier earlier;
  try {
    earlier.scenario = parse_json(text);
    for (const Json& effect : earlier.scenario.value("effects", Json::array())) {
      earlier.own.insert(effect.at("name").get<std::string>());
    }
    const Json population = earlier.scenario.value("population", Json::object());
    earlier.adoptions = population.value("adoptions", Json::array());
    if (!earlier.adoptions.is_array()) {
      return wrong("adoptions must be a list");
    }
    if (!earlier.adoptions.empty()) {
      for (const Json& name : earlier.adoptions.back().at("adopted")) {
        earlier.adopted.insert(name.get<std::string>());
      }
    }
    for (const Json& effect : population.value("effects", Json::array())) {
      const auto name = effect.at("name").get<std::string>();
      earlier.population.emplace(name, effect);
      if (!earlier.adopted.contains(name)) {
        earlier.own.insert(name);
      }
    }
    for (const Json& document : population.value("documents", Json::array())) {
      SIXPOINT_ASSIGN(DocumentEvidence evidence, evidence_from_scenario(document));
      earlier.documents.push_back(std::move(evidence));
    }
  } catch (const Json::exception& error) {
    return wrong(fmt::format("its history can't be read: {}", error.what()));
  }
  return earlier;
}

Earlier new_scenario(const std::vector<DocumentEvidence>& documents) {
  const auto engineering =
      std::ranges::count(documents, "engineering", &DocumentEvidence::protocol);
  const auto production = std::ranges::count(documents, "production", &DocumentEvidence::protocol);
  Earlier earlier;
  earlier.scenario = {{"schema", "sixpoint/scenario/1"},
                      {"seed", 1},
                      {"protocol", engineering > production ? "engineering" : "production"}};
  return earlier;
}

AdoptionChange change_of(const AdoptionDecision& decision, const Earlier& earlier) {
  if (earlier.own.contains(decision.name)) {
    return AdoptionChange::kept;
  }
  const auto before = earlier.population.find(decision.name);
  if (before == earlier.population.end()) {
    return decision.adopted() ? AdoptionChange::added : AdoptionChange::none;
  }
  if (!decision.adopted()) {
    return AdoptionChange::withdrawn;
  }
  return before->second == effect_json(decision) ? AdoptionChange::none : AdoptionChange::changed;
}

// The file: the earlier one with the population, its history and its documents.
std::string text_of(Earlier earlier, const AdoptedScenario& learnt, UtcTime made_at) {
  Json population = {
      {"effects", Json::array()}, {"adoptions", earlier.adoptions}, {"documents", Json::array()}};
  Json adoption = {{"number", learnt.adoption},
                   {"made_at", to_iso8601(made_at)},
                   {"new_documents", learnt.new_documents},
                   {"adopted", Json::array()},
                   {"withdrawn", Json::array()}};
  for (const auto& [name, effect] : earlier.population) {
    if (earlier.own.contains(name)) {
      population["effects"].push_back(effect);
    }
  }
  for (const AdoptedEffect& effect : learnt.effects) {
    if (effect.change == AdoptionChange::withdrawn) {
      adoption["withdrawn"].push_back(effect.decision.name);
    }
    if (effect.decision.adopted() && effect.change != AdoptionChange::kept) {
      population["effects"].push_back(effect_json(effect.decision));
      adoption["adopted"].push_back(effect.decision.name);
    }
  }
  population["adoptions"].push_back(std::move(adoption));
  for (const DocumentEvidence& document : learnt.documents) {
    population["documents"].push_back(to_json(document));
  }
  earlier.scenario["population"] = std::move(population);
  return earlier.scenario.dump(2) + "\n";
}

}  // namespace

std::string_view to_string(AdoptionChange change) {
  constexpr std::array<std::string_view, 5> kNames = {"none", "added", "changed", "withdrawn",
                                                      "kept"};
  return kNames[static_cast<std::size_t>(change)];
}

Result<AdoptedScenario> adopt(std::string_view scenario,
                              const std::vector<DocumentEvidence>& documents, UtcTime made_at,
                              const AdoptionOptions& options) {
  Earlier earlier;
  if (scenario.empty()) {
    earlier = new_scenario(documents);
  } else {
    SIXPOINT_ASSIGN(earlier, read_earlier(scenario));
  }
  AdoptedScenario learnt;
  learnt.adoption = static_cast<int>(earlier.adoptions.size());
  learnt.documents = earlier.documents;
  std::set<std::string> known;
  for (const DocumentEvidence& document : earlier.documents) {
    known.insert(document.id);
  }
  for (const DocumentEvidence& document : documents) {
    if (known.insert(document.id).second) {
      learnt.documents.push_back(document);
      learnt.documents.back().adoption = learnt.adoption + 1;
      ++learnt.new_documents;
    }
  }
  for (AdoptionDecision& decision : decide_adoption(learnt.documents, options)) {
    const AdoptionChange change = change_of(decision, earlier);
    learnt.effects.push_back({std::move(decision), change});
  }
  learnt.changed = learnt.new_documents > 0;
  if (learnt.changed) {
    ++learnt.adoption;
    learnt.text = text_of(std::move(earlier), learnt, made_at);
    // What was written must be a scenario that `simulate` takes.
    SIXPOINT_CHECK(sim::parse_scenario(learnt.text));
  } else {
    learnt.text = scenario;
  }
  return learnt;
}

std::vector<sim::PopulationEffect> population_of(const std::vector<AdoptionDecision>& decisions) {
  std::vector<sim::PopulationEffect> population;
  for (const AdoptionDecision& decision : decisions) {
    const auto kind = sim::find_effect(decision.name);
    if (!decision.adopted() || !kind) {
      continue;
    }
    sim::ParameterSet mean;
    sim::ParameterSet spread;
    for (const AdoptedNumber& parameter : decision.parameters) {
      for (const MeanAndSpread& number : parameter.numbers) {
        mean[parameter.parameter].push_back(number.mean);
        spread[parameter.parameter].push_back(number.spread.value_or(0));
      }
    }
    auto complete = sim::complete_parameters(**kind, mean);
    if (!complete) {
      continue;
    }
    for (const auto& [name, numbers] : *complete) {
      spread[name].resize(numbers.size(), 0);
    }
    population.push_back({*kind, *std::move(complete), std::move(spread), decision.share_of_units});
  }
  return population;
}

Result<ScenarioHistory> adoption_history(std::string_view scenario,
                                         const AdoptionOptions& options) {
  SIXPOINT_ASSIGN(const Earlier earlier, read_earlier(scenario));
  ScenarioHistory history;
  for (const DocumentEvidence& document : earlier.documents) {
    history.documents.insert(document.id);
  }
  for (const Json& adoption : earlier.adoptions) {
    PopulationState state;
    state.adoption = static_cast<int>(history.states.size()) + 1;
    const auto made_at = adoption.find("made_at");
    if (made_at != adoption.end() && made_at->is_string()) {
      state.made_at = made_at->get<std::string>();
    }
    std::vector<DocumentEvidence> until;
    for (const DocumentEvidence& document : earlier.documents) {
      if (document.adoption <= state.adoption) {
        until.push_back(document);
      }
    }
    state.documents = until.size();
    std::vector<AdoptionDecision> decisions = decide_adoption(until, options);
    std::erase_if(decisions, [&](const AdoptionDecision& decision) {
      return earlier.own.contains(decision.name);
    });
    state.population = population_of(decisions);
    history.states.push_back(std::move(state));
  }
  return history;
}

}  // namespace sixpoint::gap
