// The JSON of docs/scenario.md into a Scenario.
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "base/text/json_keys.h"
#include "base/text/json_text.h"
#include "sim/firmware.h"
#include "sim/scenario.h"
#include "sim/scenario_section.h"
#include "sim/standard_protocol.h"

namespace sixpoint::sim {

namespace {

constexpr double kLongest_s = 400 * 86'400.0;
constexpr std::size_t kMostMotions = 100'000;
// What 'gap diagnose' takes of a bundle (gap/recording/protocol.cpp): a scenario makes no others.
constexpr std::size_t kMostSegments = 1'000;
constexpr double kLeastGravity_g = 0.99;
constexpr double kMostGravity_g = 1.01;
constexpr double kColdest_c = -100;
constexpr double kHottest_c = 200;
constexpr double kLeastFrequency_hz = 1e-3;

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

Result<Section> unit_section(const Json& json) {
  return Section::of(json, "/unit",
                     {"seed", "serial", "firmware", "calibrated", "constants", "sensor", "noise_mg",
                      "accel_scale_lsb_per_g", "gain", "offset_g"});
}

Result<UnitTruth> parse_unit(const Json* json, std::uint64_t seed, bool in_protocol) {
  GivenProperties given;
  // Without another word, a unit on a station's protocol has firmware of today.
  if (in_protocol) {
    given.firmware = "1.9.2";
  }
  if (json == nullptr) {
    return draw_unit(seed, given);
  }
  SIXPOINT_ASSIGN(const Section unit, unit_section(*json));
  SIXPOINT_CHECK(unit.seed("seed", seed));
  SIXPOINT_CHECK(unit.text("serial", given.serial, 16));
  SIXPOINT_CHECK(unit.text("firmware", given.firmware, 12));
  if (given.firmware && !parse_version(*given.firmware)) {
    return wrong("/unit/firmware", "this must be a version such as 1.5.0");
  }
  SIXPOINT_CHECK(unit.time("calibrated", given.calibrated));
  SIXPOINT_CHECK(unit.axes("noise_mg", given.noise_mg, 0, 1000));
  double scale = 256;
  SIXPOINT_CHECK(unit.number("accel_scale_lsb_per_g", scale, 1, 4096));
  given.accel_scale_lsb_per_g = scale;
  if (const Json* constants = unit.find("constants"); constants != nullptr) {
    SIXPOINT_ASSIGN(
        const Section section,
        Section::of(*constants, "/unit/constants", {"positive_lsb", "negative_lsb", "zero_lsb"}));
    SIXPOINT_CHECK(
        section.axes("positive_lsb", given.positive_lsb, kStoredConstantMin, kStoredConstantMax));
    SIXPOINT_CHECK(
        section.axes("negative_lsb", given.negative_lsb, kStoredConstantMin, kStoredConstantMax));
    SIXPOINT_CHECK(
        section.axes("zero_lsb", given.zero_lsb, kStoredConstantMin, kStoredConstantMax));
  }
  if (const Json* sensor = unit.find("sensor"); sensor != nullptr) {
    SIXPOINT_ASSIGN(const Section section,
                    Section::of(*sensor, "/unit/sensor", {"legacy", "current"}));
    SIXPOINT_CHECK(
        parse_sensor(section, "legacy", given.legacy_sensitivity_lsb_per_g, given.legacy_zero_lsb));
    SIXPOINT_CHECK(parse_sensor(section, "current", given.current_sensitivity_lsb_per_g,
                                given.current_zero_lsb));
  }
  UnitTruth truth = draw_unit(seed, given);
  if (const Status valid = calib::validate(truth.constants); !valid) {
    return wrong("/unit/constants", valid.error().what);
  }
  return truth;
}

Result<Eigen::Vector3d> parse_pose(const Section& motion) {
  std::optional<std::string> name;
  SIXPOINT_CHECK(motion.text("pose", name, 2));
  constexpr std::string_view kAxisLetters = "xyz";
  const std::size_t axis = name->size() == 2 ? kAxisLetters.find((*name)[1]) : std::string::npos;
  if (axis == std::string::npos || ((*name)[0] != '+' && (*name)[0] != '-')) {
    return wrong(motion.path("pose"), "this must be one of +x -x +y -y +z -z");
  }
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  direction[static_cast<Eigen::Index>(axis)] = (*name)[0] == '+' ? 1 : -1;
  return direction;
}

Result<Eigen::Matrix3d> parse_matrix(const Json& json, const std::string& path) {
  if (!json.is_array() || json.size() != 3) {
    return wrong(path, "this must be three rows of three numbers");
  }
  Eigen::Matrix3d rotation;
  for (std::size_t row = 0; row < 3; ++row) {
    const Json& numbers = json[row];
    for (std::size_t column = 0; column < 3; ++column) {
      if (!numbers.is_array() || numbers.size() != 3 || !numbers[column].is_number()) {
        return wrong(path, "this must be three rows of three numbers");
      }
      rotation(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          numbers[column].get<double>();
    }
  }
  const double error =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < 1e-3) || rotation.determinant() < 0) {
    return wrong(path, "this is no rotation: its rows are not orthonormal");
  }
  return rotation;
}

Result<Eigen::Matrix3d> parse_rotation(const Section& motion, const std::string& path) {
  const Json* pose = motion.find("pose");
  const Json* up = motion.find("up");
  const Json* matrix = motion.find("rotation");
  if ((pose != nullptr) + (up != nullptr) + (matrix != nullptr) > 1) {
    return wrong(path, "give one of pose, up and rotation");
  }
  if (pose != nullptr) {
    SIXPOINT_ASSIGN(const Eigen::Vector3d direction, parse_pose(motion));
    return rotation_with_up(direction);
  }
  if (up != nullptr) {
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
    SIXPOINT_CHECK(motion.direction("up", direction));
    return rotation_with_up(direction);
  }
  return matrix != nullptr ? parse_matrix(*matrix, motion.path("rotation"))
                           : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

// What a unit is in a protocol: gain and offset of what it stores, and its noise.
constexpr std::uint64_t kNuisanceStream = 0x6E756973;

void draw_nuisances(ProtocolRun& run, std::uint64_t seed) {
  Random random(seed, kNuisanceStream);
  const auto normal = [&] { return std::clamp(random.normal(), -2.5, 2.5); };
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    run.gain[axis] = 1 + 0.02 * normal();
    run.offset_g[axis] = 0.035 * normal();
    run.noise_mg[axis] *= random.uniform(0.95, 1.05);
  }
}

Status parse_segment_temperature(const Section& section, std::array<double, 2>& commanded_c) {
  const Json* json = section.find("temperature_c");
  if (json == nullptr) {
    return {};
  }
  const Json list = json->is_array() ? *json : Json::array({*json, *json});
  const auto is_possible = [](const Json& value) {
    return value.is_number() && value.get<double>() >= kColdest_c &&
           value.get<double>() <= kHottest_c;
  };
  if (list.size() != 2 || !is_possible(list[0]) || !is_possible(list[1])) {
    return wrong(section.path("temperature_c"),
                 "this must be a number or [start, end], in C, from -100 to 200");
  }
  commanded_c = {list[0].get<double>(), list[1].get<double>()};
  return {};
}

Status parse_tone(const Section& section, Tone& tone) {
  SIXPOINT_CHECK(section.direction("direction_lab", tone.direction_lab));
  SIXPOINT_CHECK(section.number("frequency_hz", tone.frequency_hz, 0, 1000));
  SIXPOINT_CHECK(section.number("amplitude_g", tone.amplitude_g, 0, 100));
  return section.number("phase_rad", tone.phase_rad, -100, 100);
}

Result<ProtocolSegment> parse_segment(const Json& json, const std::string& path) {
  SIXPOINT_ASSIGN(const Section section,
                  Section::of(json, path,
                              {"name", "kind", "first_sample", "samples", "host_start_s",
                               "rotation", "temperature_c", "vibration"}));
  ProtocolSegment segment;
  std::optional<std::string> name;
  std::optional<std::string> kind;
  SIXPOINT_CHECK(section.text("name", name, 60));
  SIXPOINT_CHECK(section.text("kind", kind, 20));
  const auto parsed = parse_segment_kind(kind.value_or("still"));
  if (!parsed) {
    return wrong(section.path("kind"), "this must be still, vibration, ramp or soak");
  }
  segment.name = name.value_or(std::string(to_string(*parsed)));
  segment.kind = *parsed;
  SIXPOINT_CHECK(section.seed("first_sample", segment.first_sample));
  SIXPOINT_CHECK(section.seed("samples", segment.samples));
  SIXPOINT_CHECK(section.number("host_start_s", segment.host_start_s, 0, kLongest_s));
  SIXPOINT_ASSIGN(segment.rotation, parse_rotation(section, path));
  SIXPOINT_CHECK(parse_segment_temperature(section, segment.commanded_c));
  if (const Json* vibration = section.find("vibration"); vibration != nullptr) {
    SIXPOINT_ASSIGN(const Section tone_section,
                    Section::of(*vibration, section.path("vibration"),
                                {"direction_lab", "frequency_hz", "amplitude_g", "phase_rad"}));
    Tone tone;
    tone.direction_lab = Eigen::Vector3d::UnitZ();
    SIXPOINT_CHECK(parse_tone(tone_section, tone));
    if (tone.frequency_hz < kLeastFrequency_hz) {
      return wrong(tone_section.path("frequency_hz"), "this must be 0.001 or more");
    }
    segment.vibration = tone;
  } else if (segment.kind == SegmentKind::vibration) {
    return wrong(section.path("vibration"), "a segment of this kind must say which");
  }
  return segment;
}

// "production", "engineering", or segments as protocol.json of a bundle has them.
Result<std::vector<ProtocolSegment>> parse_segments(const Json& json, std::uint64_t seed,
                                                    double rate_hz) {
  constexpr std::uint64_t kMostSamples = 20'000'000;
  if (json.is_string()) {
    const auto standard = parse_standard_protocol(json.get_ref<const std::string&>());
    if (!standard) {
      return wrong("/protocol",
                   "this must be production, production+, engineering, or a list of segments");
    }
    return draw_protocol(*standard, seed, rate_hz);
  }
  if (!json.is_array() || json.empty() || json.size() > kMostSegments) {
    return wrong("/protocol",
                 "this must be production, production+, engineering, or a list of 1,000 segments "
                 "at most");
  }
  std::vector<ProtocolSegment> segments;
  std::uint64_t end = 0;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const std::string path = fmt::format("/protocol/{}", i);
    SIXPOINT_ASSIGN(ProtocolSegment segment, parse_segment(json[i], path));
    if (segment.first_sample != end || segment.samples == 0 ||
        segment.samples > kMostSamples - end) {
      return wrong(path + "/first_sample",
                   "each segment begins where the one before ends; 20 million samples at most");
    }
    end += segment.samples;
    segments.push_back(std::move(segment));
  }
  return segments;
}

Status parse_temperature(const Json& json, std::vector<TemperaturePoint>& points) {
  constexpr std::size_t kMostPoints = 1'000'000;
  if (!json.is_array() || json.size() > kMostPoints) {
    return wrong("/temperature", "this must be a list of [host_time_s, temperature_c]");
  }
  for (const Json& item : json) {
    if (!item.is_array() || item.size() != 2 || !item[0].is_number() || !item[1].is_number() ||
        !(std::abs(item[1].get<double>()) <= 200) ||
        (!points.empty() && !(item[0].get<double>() > points.back().host_time_s))) {
      return wrong("/temperature",
                   "this must be a list of [host_time_s, temperature_c], times rising");
    }
    points.push_back({item[0].get<double>(), item[1].get<double>()});
  }
  return {};
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
  SIXPOINT_CHECK(parse_tone(motion, spec.tone));
  SIXPOINT_CHECK(motion.seed("seed", spec.seed));
  return spec;
}

Result<EffectSpec> parse_effect(const Json& json, const std::string& path) {
  SIXPOINT_ASSIGN(const Section effect, Section::of(json, path, {"name", "parameters"}));
  std::optional<std::string> name;
  SIXPOINT_CHECK(effect.text("name", name, 60));
  EffectSpec spec;
  SIXPOINT_ASSIGN(spec.kind, effect_at(effect.path("name"), name.value_or("")));
  ParameterSet given;
  if (const Json* parameters = effect.find("parameters"); parameters != nullptr) {
    if (!parameters->is_object()) {
      return wrong(effect.path("parameters"), "this must be an object");
    }
    for (const auto& [key, value] : parameters->items()) {
      SIXPOINT_ASSIGN(given[key],
                      parse_numbers(value, fmt::format("{}/{}", effect.path("parameters"), key)));
    }
  }
  SIXPOINT_ASSIGN(spec.values, parameters_at(effect.path("parameters"), *spec.kind, given));
  SIXPOINT_CHECK(check_possible(*spec.kind, spec.values, effect.path("parameters")));
  return spec;
}

Status parse_motions(const Section& top, Scenario& scenario) {
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
  if (total_s - scenario.turn_s < 1) {
    return wrong("/motions", "together they last less than a second, and seconds are recorded");
  }
  if (static_cast<double>(to_unix_seconds(scenario.start)) + total_s >= 4294967296.0) {
    return wrong("/start", "the recording would end after the times that its records have (2106)");
  }
  return {};
}

Status parse_effects(const Section& top, Scenario& scenario) {
  if (const Json* effects = top.find("effects"); effects != nullptr) {
    if (!effects->is_array() || effects->size() > 1000) {
      return wrong("/effects", "this must be a list");
    }
    for (std::size_t i = 0; i < effects->size(); ++i) {
      SIXPOINT_ASSIGN(EffectSpec spec, parse_effect((*effects)[i], fmt::format("/effects/{}", i)));
      scenario.effects.push_back(std::move(spec));
    }
  }
  const Json* population = top.find("population");
  if (population == nullptr) {
    return {};
  }
  SIXPOINT_ASSIGN(scenario.population, parse_population(*population));
  std::uint64_t unit_seed = scenario.seed;
  if (const Json* json = top.find("unit"); json != nullptr) {
    SIXPOINT_ASSIGN(const Section unit, unit_section(*json));
    SIXPOINT_CHECK(unit.seed("seed", unit_seed));
  }
  // What the scenario itself says of an effect holds.
  std::set<const EffectKind*> own;
  for (const EffectSpec& spec : scenario.effects) {
    own.insert(spec.kind);
  }
  for (EffectSpec& spec : draw_effects(scenario.population, unit_seed)) {
    if (!own.contains(spec.kind)) {
      scenario.effects.push_back(std::move(spec));
    }
  }
  return {};
}

// What a protocol takes of the unit besides its truth: gain, offset and noise.
Status parse_protocol_unit(const Json& json, ProtocolRun& run) {
  SIXPOINT_ASSIGN(const Section unit, unit_section(json));
  if (unit.find("sensor") != nullptr) {
    return wrong(unit.path("sensor"), "beside a protocol the unit has gain and offset_g instead");
  }
  std::uint64_t seed = run.seed;
  SIXPOINT_CHECK(unit.seed("seed", seed));
  if (seed != run.seed) {
    run.noise_mg = nominal_noise_mg(run.rate_hz);
    draw_nuisances(run, seed);
  }
  const auto replace = [&unit](std::string_view key, PerAxis<double>& value, double low,
                               double high) -> Status {
    std::optional<PerAxis<double>> given;
    SIXPOINT_CHECK(unit.axes(key, given, low, high));
    value = given.value_or(value);
    return {};
  };
  SIXPOINT_CHECK(replace("gain", run.gain, -10, 10));
  SIXPOINT_CHECK(replace("offset_g", run.offset_g, -10, 10));
  return replace("noise_mg", run.noise_mg, 0, 1000);
}

Status parse_protocol(const Section& top, Scenario& scenario) {
  for (const std::string_view key : {"motions", "record", "filter", "temperature_c", "turn_s"}) {
    if (top.find(key) != nullptr) {
      return wrong(top.path(key), "this has no place beside a protocol");
    }
  }
  scenario.wide = true;
  ProtocolRun run;
  run.rate_hz = scenario.rate_hz;
  run.noise_mg = nominal_noise_mg(run.rate_hz);
  run.accel_scale_lsb_per_g = scenario.unit.accel_scale_lsb_per_g;
  run.gravity_g = scenario.gravity_g;
  run.effects = scenario.effects;
  run.seed = scenario.seed;
  run.contiguous_segments_follow = true;
  draw_nuisances(run, scenario.seed);
  if (const Json* json = top.find("unit"); json != nullptr) {
    SIXPOINT_CHECK(parse_protocol_unit(*json, run));
  }
  SIXPOINT_CHECK(top.number("seating_sd_deg", run.seating_sd_deg, 0, 10));
  SIXPOINT_ASSIGN(run.segments, parse_segments(*top.find("protocol"), scenario.seed, run.rate_hz));
  if (const Json* temperature = top.find("temperature"); temperature != nullptr) {
    SIXPOINT_CHECK(parse_temperature(*temperature, run.temperature));
  }
  if (run.temperature.empty()) {
    run.temperature = unit_temperature(run.segments, run.rate_hz);
  }
  scenario.protocol = std::move(run);
  return {};
}

Result<Scenario> parse_document(const Json& json) {
  SIXPOINT_ASSIGN(const Section top,
                  Section::of(json, "",
                              {"schema", "seed", "unit", "start", "rate_hz", "record", "filter",
                               "temperature_c", "gravity_g", "turn_s", "motions", "effects",
                               "protocol", "temperature", "seating_sd_deg", "population"}));
  std::optional<std::string> schema;
  SIXPOINT_CHECK(top.text("schema", schema, 60));
  if (schema && *schema != "sixpoint/scenario/1") {
    return wrong("/schema", "this program knows sixpoint/scenario/1");
  }
  Scenario scenario;
  SIXPOINT_CHECK(top.seed("seed", scenario.seed));
  SIXPOINT_ASSIGN(scenario.unit,
                  parse_unit(top.find("unit"), scenario.seed, top.find("protocol") != nullptr));
  std::optional<UtcTime> start;
  SIXPOINT_CHECK(top.time("start", start));
  scenario.start = start.value_or(scenario.start);
  const Json* protocol = top.find("protocol");
  double rate_hz = protocol == nullptr ? scenario.rate_hz : 100;
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
  const bool in_bundle = protocol != nullptr;
  SIXPOINT_CHECK(top.number("gravity_g", scenario.gravity_g, in_bundle ? kLeastGravity_g : 0.0,
                            in_bundle ? kMostGravity_g : 10.0));
  SIXPOINT_CHECK(top.number("turn_s", scenario.turn_s, 0, 3600));

  SIXPOINT_CHECK(parse_effects(top, scenario));
  if (protocol != nullptr) {
    SIXPOINT_CHECK(parse_protocol(top, scenario));
    return scenario;
  }
  for (const std::string_view key : {"temperature", "seating_sd_deg"}) {
    if (top.find(key) != nullptr) {
      return wrong(top.path(key), "this needs a protocol");
    }
  }
  SIXPOINT_CHECK(parse_motions(top, scenario));
  return scenario;
}

}  // namespace

Result<Scenario> parse_scenario(std::string_view json) {
  if (const auto doubled = doubled_json_key(json)) {
    return wrong(*doubled, "this key stands twice");
  }
  const Json document = parse_json<Json>(json);
  if (document.is_discarded()) {
    return wrong("", "this is not JSON: " + why_no_json(json));
  }
  try {
    return parse_document(document);
  } catch (const Json::exception& error) {
    return wrong("", error.what());
  }
}

}  // namespace sixpoint::sim
