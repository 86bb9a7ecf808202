#include "sim/effect.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

std::string_view to_string(Stage stage) {
  switch (stage) {
    case Stage::stimulus:
      return "stimulus";
    case Stage::sensor:
      return "sensor";
    case Stage::sampling:
      return "sampling";
    case Stage::digital:
      return "digital";
    case Stage::firmware:
      return "firmware";
  }
  return "?";
}

const std::vector<EffectKind>& effect_catalogue() {
  static const std::vector<EffectKind> kCatalogue = {
      tilt_kind(),        misalignment_kind(), second_order_kind(),   offset_tempco_kind(),
      clock_error_kind(), truncation_kind(),   charging_zeros_kind(),
  };
  return kCatalogue;
}

Result<const EffectKind*> find_effect(std::string_view name) {
  std::vector<std::string_view> names;
  for (const EffectKind& kind : effect_catalogue()) {
    if (kind.name == name) {
      return &kind;
    }
    names.push_back(kind.name);
  }
  return fail(ErrorCode::configuration, fmt::format("there is no effect '{}'", printable(name, 60)),
              {}, fmt::format("use one of: {}", fmt::join(names, ", ")));
}

Result<ParameterSet> complete_parameters(const EffectKind& kind, const ParameterSet& given) {
  ParameterSet values;
  for (const Parameter& parameter : kind.parameters) {
    values[parameter.name] = parameter.default_value;
  }
  for (const auto& [name, numbers] : given) {
    const auto value = values.find(name);
    if (value == values.end()) {
      return fail(
          ErrorCode::configuration,
          fmt::format("the effect '{}' has no parameter '{}'", kind.name, printable(name, 60)), {},
          "docs/scenario.md lists the parameters of every effect");
    }
    if (numbers.size() != value->second.size() ||
        !std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
      return fail(ErrorCode::configuration,
                  fmt::format("'{}' of the effect '{}' takes {} finite number(s)", name, kind.name,
                              value->second.size()),
                  {}, "docs/scenario.md lists the parameters of every effect");
    }
    value->second = numbers;
  }
  return values;
}

std::vector<std::unique_ptr<Effect>> make_effects(const std::vector<EffectSpec>& specs,
                                                  std::uint64_t seed) {
  std::vector<std::unique_ptr<Effect>> effects;
  effects.reserve(specs.size());
  for (std::size_t i = 0; i < specs.size(); ++i) {
    effects.push_back(specs[i].kind->make(specs[i].values, Random(seed, 100 + i)));
  }
  return effects;
}

Eigen::Matrix3d rotation_by_deg(const std::vector<double>& rotation_vector_deg) {
  const Eigen::Vector3d vector =
      Eigen::Vector3d(rotation_vector_deg[0], rotation_vector_deg[1], rotation_vector_deg[2]) *
      (std::numbers::pi / 180);
  const double angle = vector.norm();
  return angle == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                    : Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

}  // namespace sixpoint::sim
