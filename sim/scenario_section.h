// An object of a scenario's JSON: its known keys, and its values with their limits.
//
//   SIXPOINT_ASSIGN(const Section unit, Section::of(json, "/unit", {"seed", "gain"}));
//   double gain = 1;
//   SIXPOINT_CHECK(unit.number("gain", gain, 0, 10));  // stays 1 where the key is missing
//
// Every error is `configuration` and names the path of the key. Private to the files that read
// JSON.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "base/result.h"
#include "base/time.h"
#include "sim/effects/population.h"

namespace sixpoint::sim {

using Json = nlohmann::json;

inline tl::unexpected<Error> wrong(const std::string& path, std::string what) {
  return fail(ErrorCode::configuration, std::move(what),
              path.empty() ? "scenario" : "scenario: " + printable(path, 100),
              "docs/scenario.md describes every key");
}

// find_effect() and complete_parameters(), whose errors know no path.
inline Result<const EffectKind*> effect_at(const std::string& path, std::string_view name) {
  auto kind = find_effect(name);
  if (!kind) {
    kind.error().where = wrong(path, {}).value().where;
  }
  return kind;
}
inline Result<ParameterSet> parameters_at(const std::string& path, const EffectKind& kind,
                                          const ParameterSet& given) {
  for (const auto& one : given) {
    if (auto alone = complete_parameters(kind, {one}); !alone) {
      alone.error().where = wrong(fmt::format("{}/{}", path, one.first), {}).value().where;
      return alone;
    }
  }
  return complete_parameters(kind, given);
}

// Refers to the JSON, which must outlive it.
class Section {
 public:
  static Result<Section> of(const Json& json, std::string path,
                            std::initializer_list<std::string_view> keys) {
    if (!json.is_object()) {
      return wrong(path, "this must be an object");
    }
    for (const auto& [key, value] : json.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
        return wrong(fmt::format("{}/{}", path, key), "this key is not known");
      }
    }
    return Section(json, std::move(path));
  }

  const Json* find(std::string_view key) const {
    const auto found = json_->find(std::string(key));
    return found == json_->end() ? nullptr : &*found;
  }
  std::string path(std::string_view key) const { return fmt::format("{}/{}", path_, key); }

  Status number(std::string_view key, double& value, double low, double high) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    if (!found->is_number() || !(found->get<double>() >= low && found->get<double>() <= high)) {
      return wrong(path(key), fmt::format("this must be a number from {} to {}", low, high));
    }
    value = found->get<double>();
    return {};
  }
  Status seed(std::string_view key, std::uint64_t& value) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    if (!found->is_number_unsigned()) {
      return wrong(path(key), "this must be a whole number that is not negative");
    }
    value = found->get<std::uint64_t>();
    return {};
  }
  Status text(std::string_view key, std::optional<std::string>& value, std::size_t limit) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    const bool good = found->is_string() && !found->get_ref<const std::string&>().empty() &&
                      found->get_ref<const std::string&>().size() <= limit;
    if (!good || !std::all_of(found->get_ref<const std::string&>().begin(),
                              found->get_ref<const std::string&>().end(),
                              [](char c) { return c >= ' ' && c <= '~'; })) {
      return wrong(path(key),
                   fmt::format("this must be a text of 1 to {} ASCII characters", limit));
    }
    value = found->get<std::string>();
    return {};
  }
  Status time(std::string_view key, std::optional<UtcTime>& value) const {
    std::optional<std::string> spelled;
    SIXPOINT_CHECK(text(key, spelled, 40));
    if (spelled) {
      const auto parsed = parse_iso8601(*spelled);
      if (!parsed || *parsed < from_unix_seconds(0) ||
          *parsed >= from_unix_seconds(std::int64_t{1} << 32U) ||
          *parsed != std::chrono::floor<std::chrono::seconds>(*parsed)) {
        return wrong(path(key),
                     "this must be a whole second such as 2015-04-09T14:00:00Z, 1970 to 2106");
      }
      value = *parsed;
    }
    return {};
  }
  template <class Number>
  Status axes(std::string_view key, std::optional<PerAxis<Number>>& value, double low,
              double high) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    bool good = found->is_array() && found->size() == kAxes;
    PerAxis<Number> numbers{};
    for (std::size_t axis = 0; good && axis < kAxes; ++axis) {
      const Json& item = (*found)[axis];
      good = (std::is_integral_v<Number> ? item.is_number_integer() : item.is_number()) &&
             item.get<double>() >= low && item.get<double>() <= high;
      if (good) {
        numbers[axis] = item.get<Number>();
      }
    }
    if (!good) {
      return wrong(path(key), fmt::format("this must be three {}numbers from {} to {}",
                                          std::is_integral_v<Number> ? "whole " : "", low, high));
    }
    value = numbers;
    return {};
  }
  // A vector of any length but 0.
  Status direction(std::string_view key, Eigen::Vector3d& value) const {
    std::optional<PerAxis<double>> numbers;
    SIXPOINT_CHECK(axes(key, numbers, -1e6, 1e6));
    if (numbers) {
      value = {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
    }
    return value.norm() < 1e-6 ? Status(wrong(path(key), "this must have a direction")) : Status();
  }

 private:
  Section(const Json& json, std::string path) : json_(&json), path_(std::move(path)) {}
  const Json* json_;
  std::string path_;
};

// A number, three, or three rows of three, as one list.
inline Result<std::vector<double>> parse_numbers(const Json& json, const std::string& path) {
  std::vector<double> numbers;
  for (const Json& row : json.is_array() ? json : Json::array({json})) {
    for (const Json& item : row.is_array() ? row : Json::array({row})) {
      if (!item.is_number() || numbers.size() == kAxes * kAxes) {
        return wrong(path, "this must be a number, three, or three rows of three");
      }
      numbers.push_back(item.get<double>());
    }
  }
  return numbers;
}

inline bool names_each_axis_once(const std::vector<double>& matrix) {
  const auto there = [&](std::size_t row, std::size_t column) {
    return matrix[kAxes * row + column] != 0 ? 1 : 0;
  };
  for (std::size_t i = 0; i < kAxes; ++i) {
    if (there(i, 0) + there(i, 1) + there(i, 2) != 1 ||
        there(0, i) + there(1, i) + there(2, i) != 1) {
      return false;
    }
  }
  return true;
}

// What the numbers of an effect's parameter must be ("from 0 to 50"), where these are not possible:
//
// | parameter                                                     | possible numbers                   |
// |---------------------------------------------------------------|------------------------------------|
// | unit 1, between whole numbers (`order`, `matrix`)             | whole numbers of the range; of     |
// |                                                               | nine, one of each row and column   |
// |                                                               | is not 0: axes, each once          |
// | range above 0 (`corner_hz`)                                   | above 0, up to a hundred times its |
// |                                                               | end                                |
// | range from 0 on (`sd_deg`)                                    | from 0, up to a hundred times it   |
// | range with negative numbers (`ppm`)                           | up to a hundred times the larger   |
// |                                                               | end, of either sign                |
// | of these three, unit 1 and a range within -1 to 1 (`rate`)    | at most 1: a share                 |
inline std::optional<std::string> impossible(const Parameter& parameter,
                                             const std::vector<double>& numbers) {
  constexpr double kBeyond = 100;
  const auto is_whole = [](double x) { return x == std::round(x); };
  const bool share_or_count = parameter.unit == "1";
  const bool whole =
      share_or_count && parameter.low != 0 && is_whole(parameter.low) && is_whole(parameter.high);
  const bool above = parameter.low > 0 && !whole;  // 0 itself is none
  const double end = std::max(std::abs(parameter.low), parameter.high);
  double most = share_or_count && end <= 1 ? 1 : kBeyond * end;
  double least = parameter.low < 0 ? -most : 0;
  if (whole) {
    least = parameter.low;
    most = parameter.high;
  }
  const bool possible = std::ranges::all_of(numbers, [&](double x) {
    return (above ? x > least : x >= least) && x <= most && (!whole || is_whole(x));
  });
  if (possible && whole && numbers.size() == kAxes * kAxes && !names_each_axis_once(numbers)) {
    return "0 but for one of each row and column";
  }
  if (possible) {
    return std::nullopt;
  }
  return above ? fmt::format("above 0 and at most {:g}", most)
               : fmt::format("{}from {:g} to {:g}", whole ? "whole, " : "", least, most);
}

// Of the parameters of an effect, which stand under `path`.
inline Status check_possible(const EffectKind& kind, const ParameterSet& values,
                             const std::string& path) {
  for (const Parameter& parameter : kind.parameters) {
    if (const auto must_be = impossible(parameter, values.at(parameter.name))) {
      return wrong(fmt::format("{}/{}", path, parameter.name),
                   fmt::format("each number must be {}", *must_be));
    }
  }
  return {};
}

// population_json.cpp: /population of a scenario.
Result<std::vector<PopulationEffect>> parse_population(const Json& json);

}  // namespace sixpoint::sim
