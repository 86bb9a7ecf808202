#include "gap/adopt/learnt_sizes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "gap/explain/forward.h"
#include "sim/scenario.h"

namespace sixpoint::gap {

namespace {

using Json = nlohmann::ordered_json;

// The numbers of the first parameter; empty where it is not given.
std::vector<double> numbers_of(const Json& effect, const char* key, const std::string& parameter) {
  const Json& all = effect.value(key, Json::object());
  const Json& one = all.is_object() ? all.value(parameter, Json()) : Json();
  if (one.is_number()) {
    return {one.get<double>()};
  }
  std::vector<double> numbers;
  for (const Json& number : one.is_array() ? one : Json::array()) {
    numbers.push_back(number.is_number() ? number.get<double>() : NAN);
  }
  return numbers;
}

// Null where no two units were there to differ.
bool spread_is_unknown(const Json& effect, const std::string& parameter) {
  const Json& all = effect.value("spread", Json::object());
  return all.is_null() || (all.is_object() && all.contains(parameter) && all[parameter].is_null());
}

// Standard deviation of Student's t of units - 1 degrees of freedom.
double widened(std::size_t units, const LearntSizesOptions& options) {
  const auto n = static_cast<double>(units);
  return units == 0 ? 1 : units < 4 ? options.widened_for_few : std::sqrt((n - 1) / (n - 3));
}

// `group`: of this effect, at its typical size. None where nothing is known of the next unit.
std::optional<LearntSize> learnt_of(const sim::PopulationEffect& parsed, const Json& effect,
                                    const ParameterGroup& group,
                                    const LearntSizesOptions& options) {
  const std::string& parameter = parsed.kind->parameters.front().name;
  LearntSize learnt{.effect = group.effect, .share_of_units = parsed.share_of_units};
  const Json units = effect.value("units", Json(0));
  learnt.units = units.is_number_unsigned() ? units.get<std::size_t>() : 0;
  learnt.mean = parsed.mean.at(parameter);
  learnt.sd = parsed.spread.at(parameter);
  const std::vector<double> uncertainty = numbers_of(effect, "standard_uncertainty", parameter);
  if (learnt.units == 1 || spread_is_unknown(effect, parameter)) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < learnt.sd.size(); ++i) {
    learnt.mean[i] -= absent_value(group.effect);
    const double own = i < uncertainty.size() && std::isfinite(uncertainty[i]) ? uncertainty[i] : 0;
    learnt.sd[i] = std::max(std::hypot(learnt.sd[i], own) * widened(learnt.units, options),
                            options.least_share_of_typical * group.prior_sd);
  }
  // A jig's tilt has two numbers; the third, a turn about the vertical, moves nothing.
  const auto count = static_cast<std::size_t>(std::min(3, group.count));
  learnt.mean.resize(count);
  learnt.sd.resize(count);
  return learnt;
}

}  // namespace

Result<std::vector<LearntSize>> learnt_sizes(std::string_view scenario,
                                             const LearntSizesOptions& options) {
  // Checks it, and drops `units` and `standard_uncertainty`.
  SIXPOINT_ASSIGN(const sim::Scenario parsed, sim::parse_scenario(scenario));
  const Json text = parse_json(scenario);
  if (!text.contains("population")) {
    return fail(ErrorCode::configuration, "this scenario has no population", "/population",
                "sixpoint gap adopt writes one; docs/scenario.md describes every key");
  }
  const std::vector<ParameterGroup> groups = parameter_groups();
  std::vector<LearntSize> learnt;
  for (const Json& effect : text["population"]["effects"]) {
    const std::string name = effect["name"];
    const auto own = std::ranges::find(parsed.population, name,
                                       [](const auto& known) { return known.kind->name; });
    // The first group of an effect is that of its typical size.
    const auto group = std::ranges::find(groups, name, &ParameterGroup::effect);
    if (own == parsed.population.end() || group == groups.end() || name == "truncation") {
      continue;
    }
    if (auto size = learnt_of(*own, effect, *group, options)) {
      learnt.push_back(*std::move(size));
    }
  }
  std::ranges::sort(learnt, {}, &LearntSize::effect);
  return learnt;
}

}  // namespace sixpoint::gap
