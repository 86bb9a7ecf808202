// The key `population` of a scenario.
#include <algorithm>
#include <utility>

#include "sim/scenario_section.h"

namespace sixpoint::sim {

namespace {

constexpr double kMostSpread = 1e6;

// The numbers of `key`, complete: of the effect's defaults, or zeros, where it does not say.
Result<ParameterSet> parse_numbers_of(const Section& effect, std::string_view key,
                                      const EffectKind& kind, bool spread) {
  ParameterSet given;
  if (const Json* json = effect.find(key); json != nullptr) {
    if (!json->is_object()) {
      return wrong(effect.path(key), "this must be an object");
    }
    for (const auto& [name, value] : json->items()) {
      const std::string path = fmt::format("{}/{}", effect.path(key), name);
      if (spread && value.is_null()) {
        continue;  // not known: one unit
      }
      SIXPOINT_ASSIGN(given[name], parse_numbers(value, path));
      if (spread && std::ranges::any_of(
                        given[name], [](double sd) { return !(sd >= 0 && sd <= kMostSpread); })) {
        return wrong(path, "a spread is not negative");
      }
    }
  }
  SIXPOINT_ASSIGN(ParameterSet complete, parameters_at(effect.path(key), kind, given));
  if (!spread) {
    SIXPOINT_CHECK(check_possible(kind, complete, effect.path(key)));
  } else {
    for (auto& [name, numbers] : complete) {
      if (!given.contains(name)) {
        std::fill(numbers.begin(), numbers.end(), 0);
      }
    }
  }
  return complete;
}

}  // namespace

Result<std::vector<PopulationEffect>> parse_population(const Json& json) {
  // Where the numbers come from is for `sixpoint gap adopt` and for people.
  SIXPOINT_ASSIGN(const Section top,
                  Section::of(json, "/population", {"effects", "adoptions", "documents"}));
  std::vector<PopulationEffect> population;
  const Json* list = top.find("effects");
  if (list == nullptr || !list->is_array() || list->size() > 1000) {
    return wrong(top.path("effects"), "this must be a list");
  }
  for (std::size_t i = 0; i < list->size(); ++i) {
    SIXPOINT_ASSIGN(const Section effect,
                    Section::of((*list)[i], fmt::format("{}/{}", top.path("effects"), i),
                                {"name", "share_of_units", "mean", "spread", "standard_uncertainty",
                                 "units", "bundles", "common"}));
    std::optional<std::string> name;
    SIXPOINT_CHECK(effect.text("name", name, 60));
    PopulationEffect parsed;
    SIXPOINT_ASSIGN(parsed.kind, effect_at(effect.path("name"), name.value_or("")));
    if (std::ranges::any_of(population, [&](const auto& p) { return p.kind == parsed.kind; })) {
      return wrong(effect.path("name"), "this effect stands here twice");
    }
    SIXPOINT_CHECK(effect.number("share_of_units", parsed.share_of_units, 0, 1));
    SIXPOINT_ASSIGN(parsed.mean, parse_numbers_of(effect, "mean", *parsed.kind, false));
    SIXPOINT_ASSIGN(parsed.spread, parse_numbers_of(effect, "spread", *parsed.kind, true));
    population.push_back(std::move(parsed));
  }
  return population;
}

}  // namespace sixpoint::sim
