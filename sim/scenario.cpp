#include "sim/scenario.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/firmware.h"

namespace sixpoint::sim {

namespace {

using Json = nlohmann::json;

constexpr double kLongest_s = 400 * 86'400.0;
constexpr std::size_t kMostMotions = 100'000;

tl::unexpected<Error> wrong(const std::string& path, std::string what) {
  return fail(ErrorCode::configuration, std::move(what), "scenario: " + printable(path, 100),
              "docs/scenario.md describes every key");
}

// An object of the scenario with its path, and the keys that were asked for.
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
          *parsed >= from_unix_seconds(std::int64_t{1} << 32U)) {
        return wrong(path(key), "this must be a time such as 2015-04-09T14:00:00Z, 1970 to 2106");
      }
      value = std::chrono::floor<std::chrono::seconds>(*parsed);
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

 private:
  Section(const Json& json, std::string path) : json_(&json), path_(std::move(path)) {}
  const Json* json_;
  std::string path_;
};

Status parse_sensor(const Section& parent, std::string_view key,
                    std::optional<PerAxis<double>>& sensitivity,
                    std::optional<PerAxis<double>>& zero) {
  const Json* json = parent.find(key);
  if (json == nullptr) {
    return {};
  }
  SIXPOINT_ASSIGN(const Section section,
                  Section::of(*json, parent.path(key), {"sensitivity_lsb_per_g", "zero_lsb"}));
  SIXPOINT_CHECK(section.axes("sensitivity_lsb_per_g", sensitivity, 1, 2047));
  return section.axes("zero_lsb", zero, -2048, 2047);
}

Result<UnitTruth> parse_unit(const Json* json, std::uint64_t seed) {
  UnitWishes wishes;
  if (json == nullptr) {
    return draw_unit(seed, wishes);
  }
  SIXPOINT_ASSIGN(const Section unit,
                  Section::of(*json, "/unit",
                              {"seed", "serial", "firmware", "calibrated", "constants", "sensor",
                               "noise_mg", "accel_scale_lsb_per_g"}));
  SIXPOINT_CHECK(unit.seed("seed", seed));
  SIXPOINT_CHECK(unit.text("serial", wishes.serial, 16));
  SIXPOINT_CHECK(unit.text("firmware", wishes.firmware, 12));
  if (wishes.firmware && !parse_version(*wishes.firmware)) {
    return wrong("/unit/firmware", "this must be a version such as 1.5.0");
  }
  SIXPOINT_CHECK(unit.time("calibrated", wishes.calibrated));
  SIXPOINT_CHECK(unit.axes("noise_mg", wishes.noise_mg, 0, 1000));
  double scale = 256;
  SIXPOINT_CHECK(unit.number("accel_scale_lsb_per_g", scale, 1, 4096));
  wishes.accel_scale_lsb_per_g = scale;
  if (const Json* constants = unit.find("constants"); constants != nullptr) {
    SIXPOINT_ASSIGN(
        const Section section,
        Section::of(*constants, "/unit/constants", {"positive_lsb", "negative_lsb", "zero_lsb"}));
    SIXPOINT_CHECK(
        section.axes("positive_lsb", wishes.positive_lsb, kStoredConstantMin, kStoredConstantMax));
    SIXPOINT_CHECK(
        section.axes("negative_lsb", wishes.negative_lsb, kStoredConstantMin, kStoredConstantMax));
    SIXPOINT_CHECK(
        section.axes("zero_lsb", wishes.zero_lsb, kStoredConstantMin, kStoredConstantMax));
  }
  if (const Json* sensor = unit.find("sensor"); sensor != nullptr) {
    SIXPOINT_ASSIGN(const Section section,
                    Section::of(*sensor, "/unit/sensor", {"legacy", "current"}));
    SIXPOINT_CHECK(parse_sensor(section, "legacy", wishes.legacy_sensitivity_lsb_per_g,
                                wishes.legacy_zero_lsb));
    SIXPOINT_CHECK(parse_sensor(section, "current", wishes.current_sensitivity_lsb_per_g,
                                wishes.current_zero_lsb));
  }
  UnitTruth truth = draw_unit(seed, wishes);
  if (const Status valid = calib::validate(truth.constants); !valid) {
    return wrong("/unit/constants", valid.error().what);
  }
  return truth;
}

Result<Eigen::Matrix3d> parse_rotation(const Section& motion, const std::string& path) {
  const Json* pose = motion.find("pose");
  const Json* up = motion.find("up");
  const Json* matrix = motion.find("rotation");
  if ((pose != nullptr) + (up != nullptr) + (matrix != nullptr) > 1) {
    return wrong(path, "give one of pose, up and rotation");
  }
  if (pose != nullptr) {
    std::optional<std::string> name;
    SIXPOINT_CHECK(motion.text("pose", name, 2));
    constexpr std::string_view kAxisLetters = "xyz";
    const std::size_t axis = name->size() == 2 ? kAxisLetters.find((*name)[1]) : std::string::npos;
    if (axis == std::string::npos || ((*name)[0] != '+' && (*name)[0] != '-')) {
      return wrong(motion.path("pose"), "this must be one of +x -x +y -y +z -z");
    }
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
    direction[static_cast<Eigen::Index>(axis)] = (*name)[0] == '+' ? 1 : -1;
    return rotation_with_up(direction);
  }
  if (up != nullptr) {
    std::optional<PerAxis<double>> direction;
    SIXPOINT_CHECK(motion.axes("up", direction, -1e6, 1e6));
    const Eigen::Vector3d vector((*direction)[0], (*direction)[1], (*direction)[2]);
    if (vector.norm() < 1e-6) {
      return wrong(motion.path("up"), "this must have a direction");
    }
    return rotation_with_up(vector);
  }
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  if (matrix != nullptr) {
    if (!matrix->is_array() || matrix->size() != 3) {
      return wrong(motion.path("rotation"), "this must be three rows of three numbers");
    }
    for (std::size_t row = 0; row < 3; ++row) {
      const Json& numbers = (*matrix)[row];
      for (std::size_t column = 0; column < 3; ++column) {
        if (!numbers.is_array() || numbers.size() != 3 || !numbers[column].is_number()) {
          return wrong(motion.path("rotation"), "this must be three rows of three numbers");
        }
        rotation(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
            numbers[column].get<double>();
      }
    }
    const double error =
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    if (!(error < 1e-3) || rotation.determinant() < 0) {
      return wrong(motion.path("rotation"), "this is no rotation: its rows are not orthonormal");
    }
  }
  return rotation;
}

Result<MotionSpec> parse_motion(const Json& json, const std::string& path, std::uint64_t seed) {
  SIXPOINT_ASSIGN(const Section motion,
                  Section::of(json, path,
                              {"kind", "duration_s", "pose", "up", "rotation", "direction_lab",
                               "frequency_hz", "amplitude_g", "phase_rad", "seed"}));
  MotionSpec spec;
  spec.seed = seed;
  std::optional<std::string> kind;
  SIXPOINT_CHECK(motion.text("kind", kind, 20));
  if (kind == "still") {
    spec.kind = MotionKind::still;
  } else if (kind == "shaker") {
    spec.kind = MotionKind::shaker;
  } else if (kind == "free_living") {
    spec.kind = MotionKind::free_living;
  } else {
    return wrong(motion.path("kind"), "this must be still, shaker or free_living");
  }
  SIXPOINT_CHECK(motion.number("duration_s", spec.duration_s, 0.001, kLongest_s));
  SIXPOINT_ASSIGN(spec.rotation, parse_rotation(motion, path));
  std::optional<PerAxis<double>> direction;
  SIXPOINT_CHECK(motion.axes("direction_lab", direction, -1e6, 1e6));
  if (direction) {
    spec.tone.direction_lab = {(*direction)[0], (*direction)[1], (*direction)[2]};
    if (spec.tone.direction_lab.norm() < 1e-6) {
      return wrong(motion.path("direction_lab"), "this must have a direction");
    }
  }
  SIXPOINT_CHECK(motion.number("frequency_hz", spec.tone.frequency_hz, 0, 1000));
  SIXPOINT_CHECK(motion.number("amplitude_g", spec.tone.amplitude_g, 0, 100));
  SIXPOINT_CHECK(motion.number("phase_rad", spec.tone.phase_rad, -100, 100));
  SIXPOINT_CHECK(motion.seed("seed", spec.seed));
  return spec;
}

Result<EffectSpec> parse_effect(const Json& json, const std::string& path) {
  SIXPOINT_ASSIGN(const Section effect, Section::of(json, path, {"name", "parameters"}));
  std::optional<std::string> name;
  SIXPOINT_CHECK(effect.text("name", name, 60));
  EffectSpec spec;
  SIXPOINT_ASSIGN(spec.kind, find_effect(name.value_or("")));
  ParameterSet given;
  if (const Json* parameters = effect.find("parameters"); parameters != nullptr) {
    if (!parameters->is_object()) {
      return wrong(effect.path("parameters"), "this must be an object");
    }
    for (const auto& [key, value] : parameters->items()) {
      const std::string where = fmt::format("{}/{}", effect.path("parameters"), key);
      std::vector<double>& numbers = given[key];
      const Json list = value.is_array() ? value : Json::array({value});
      for (const Json& item : list) {
        if (!item.is_number() || list.size() > kAxes) {
          return wrong(where, "this must be a number or three");
        }
        numbers.push_back(item.get<double>());
      }
    }
  }
  SIXPOINT_ASSIGN(spec.values, complete_parameters(*spec.kind, given));
  return spec;
}

Result<Scenario> parse_document(const Json& json) {
  SIXPOINT_ASSIGN(const Section top,
                  Section::of(json, "",
                              {"schema", "seed", "unit", "start", "rate_hz", "record", "filter",
                               "temperature_c", "gravity_g", "turn_s", "motions", "effects"}));
  std::optional<std::string> schema;
  SIXPOINT_CHECK(top.text("schema", schema, 60));
  if (schema && *schema != "sixpoint/scenario/1") {
    return wrong("/schema", "this program knows sixpoint/scenario/1");
  }
  Scenario scenario;
  SIXPOINT_CHECK(top.seed("seed", scenario.seed));
  SIXPOINT_ASSIGN(scenario.unit, parse_unit(top.find("unit"), scenario.seed));
  std::optional<UtcTime> start;
  SIXPOINT_CHECK(top.time("start", start));
  scenario.start = start.value_or(scenario.start);
  double rate_hz = scenario.rate_hz;
  SIXPOINT_CHECK(top.number("rate_hz", rate_hz, 1, 1000));
  if (rate_hz != std::floor(rate_hz)) {
    return wrong("/rate_hz", "this must be a whole number");
  }
  scenario.rate_hz = static_cast<int>(rate_hz);
  std::optional<std::string> record;
  SIXPOINT_CHECK(top.text("record", record, 20));
  if (record && *record != "activity" && *record != "activity2") {
    return wrong("/record", "this must be activity or activity2");
  }
  scenario.wide = record == "activity2";
  std::optional<std::string> filter;
  SIXPOINT_CHECK(top.text("filter", filter, 20));
  if (filter) {
    const auto parsed = calib::parse_filter_configuration(*filter);
    if (!parsed) {
      return wrong("/filter", "this must be legacy or current");
    }
    scenario.filter = *parsed;
  }
  SIXPOINT_CHECK(top.number("temperature_c", scenario.temperature_c, -100, 200));
  SIXPOINT_CHECK(top.number("gravity_g", scenario.gravity_g, 0, 10));
  SIXPOINT_CHECK(top.number("turn_s", scenario.turn_s, 0, 3600));

  const Json* motions = top.find("motions");
  if (motions == nullptr || !motions->is_array() || motions->empty() ||
      motions->size() > kMostMotions) {
    return wrong("/motions", "this must be a list of at least one motion");
  }
  double total_s = 0;
  for (std::size_t i = 0; i < motions->size(); ++i) {
    SIXPOINT_ASSIGN(
        const MotionSpec spec,
        parse_motion((*motions)[i], fmt::format("/motions/{}", i), scenario.seed + 1000 + i));
    total_s += spec.duration_s + scenario.turn_s;
    scenario.motions.push_back(spec);
  }
  if (total_s > kLongest_s) {
    return wrong("/motions", "together they last longer than 400 days");
  }
  if (const Json* effects = top.find("effects"); effects != nullptr) {
    if (!effects->is_array() || effects->size() > 1000) {
      return wrong("/effects", "this must be a list");
    }
    for (std::size_t i = 0; i < effects->size(); ++i) {
      SIXPOINT_ASSIGN(EffectSpec spec, parse_effect((*effects)[i], fmt::format("/effects/{}", i)));
      scenario.effects.push_back(std::move(spec));
    }
  }
  return scenario;
}

}  // namespace

FilterConfiguration Scenario::filter_in_force() const {
  return filter.value_or(filter_of_recording(unit.serial, unit.firmware, unit.calibrated));
}

std::unique_ptr<MotionSequence> Scenario::motion() const {
  auto sequence = std::make_unique<MotionSequence>();
  std::uint64_t turn_seed = seed;
  for (const MotionSpec& spec : motions) {
    std::unique_ptr<Motion> next;
    switch (spec.kind) {
      case MotionKind::still:
        next = still(spec.rotation, gravity_g);
        break;
      case MotionKind::shaker:
        next = shaker(spec.rotation, spec.tone, gravity_g);
        break;
      case MotionKind::free_living:
        next = free_living(spec.duration_s, spec.seed, gravity_g);
        break;
    }
    if (turn_s > 0 && sequence->duration_s() > 0) {
      MotionState before;
      MotionState after;
      sequence->at(sequence->duration_s(), before);
      next->at(0, after);
      sequence->add(turn(before.rotation, after.rotation, turn_s, ++turn_seed, gravity_g), turn_s);
    }
    sequence->add(std::move(next), spec.duration_s);
  }
  return sequence;
}

std::vector<std::unique_ptr<Effect>> Scenario::make_effects() const {
  std::vector<std::unique_ptr<Effect>> list;
  for (std::size_t i = 0; i < effects.size(); ++i) {
    list.push_back(effects[i].kind->make(effects[i].values, Random(seed, 100 + i)));
  }
  return list;
}

Result<Scenario> parse_scenario(std::string_view json) {
  const Json document = Json::parse(json, nullptr, false);
  if (document.is_discarded()) {
    return wrong("", "this is not JSON");
  }
  try {
    return parse_document(document);
  } catch (const Json::exception& error) {
    return wrong("", error.what());
  }
}

}  // namespace sixpoint::sim
