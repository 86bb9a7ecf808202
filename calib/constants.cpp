#include "calib/constants.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"

namespace sixpoint::calib {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kMaxZero_lsb = 32768;
constexpr double kMinSensitivity = 1.0 / 32768;
constexpr double kMaxSensitivity = 1.0;
constexpr std::string_view kHint =
    "take the constants from the unit, from the store or from another recording of it";

tl::unexpected<Error> bad_constants(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), "constants", std::string(kHint));
}

Result<double> read_number(const Json& json, const std::string& where) {
  if (!json.is_number()) {
    return fail(ErrorCode::bad_data, "is not a number", where, "write the file with sixpoint");
  }
  const auto value = json.get<double>();
  if (!std::isfinite(value)) {
    return fail(ErrorCode::bad_data, "is not finite", where, "write the file with sixpoint");
  }
  return value;
}

template <class T>
Result<PerAxis<T>> read_axes(const Json& parent, const char* key) {
  const std::string where = fmt::format("constants.json, {}", key);
  const auto found = parent.find(key);
  if (found == parent.end() || !found->is_array() || found->size() != kAxes) {
    return fail(ErrorCode::bad_data, fmt::format("{} is not an array of three numbers, X Y Z", key),
                where, "write the file with sixpoint");
  }
  PerAxis<T> out{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    SIXPOINT_ASSIGN(const double value, read_number((*found)[a], where));
    if constexpr (std::is_integral_v<T>) {
      if (value != std::floor(value) || std::abs(value) > 1e6) {
        return fail(ErrorCode::bad_data, "is not a whole number of counts", where,
                    "write the file with sixpoint");
      }
    }
    out[a] = static_cast<T>(value);
  }
  return out;
}

Result<PerAxis<double>> read_uncertainties(const Json& parent, const char* key) {
  SIXPOINT_ASSIGN(const auto values, read_axes<double>(parent, key));
  if (std::ranges::any_of(values, [](double value) { return value < 0; })) {
    return fail(ErrorCode::bad_data, "an uncertainty is below 0",
                fmt::format("constants.json, {}", key), "write the file with sixpoint");
  }
  return values;
}

std::string read_text(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

tl::unexpected<Error> bad_record(std::string what, std::string where = "constants.json") {
  return fail(ErrorCode::bad_data, std::move(what), std::move(where),
              "write the file with 'sixpoint solve -o' or 'sixpoint jig'");
}

// The doubles, the nine integers, or both; then the doubles hold.
Status read_constants(const Json& json, ConstantsRecord& record) {
  StoredConstants& stored = record.stored;
  const bool has_doubles = json.contains("sensitivity_g_per_lsb");
  if (has_doubles) {
    SIXPOINT_ASSIGN(record.calibration.sensitivity_g_per_lsb,
                    read_axes<double>(json, "sensitivity_g_per_lsb"));
    SIXPOINT_ASSIGN(record.calibration.zero_lsb, read_axes<double>(json, "zero_lsb"));
    SIXPOINT_CHECK(validate(record.calibration));
    if (!json.contains("positive_lsb")) {
      SIXPOINT_ASSIGN(stored, nearest_stored(record.calibration));
      return {};
    }
  }
  SIXPOINT_ASSIGN(stored.positive_lsb, read_axes<int>(json, "positive_lsb"));
  SIXPOINT_ASSIGN(stored.negative_lsb, read_axes<int>(json, "negative_lsb"));
  const char* zero_key = has_doubles ? "stored_zero_lsb" : "zero_lsb";
  if (!has_doubles || json.contains(zero_key)) {
    SIXPOINT_ASSIGN(stored.zero_lsb, read_axes<int>(json, zero_key));
  } else {
    for (std::size_t a = 0; a < kAxes; ++a) {
      stored.zero_lsb[a] = static_cast<int>(std::lround(record.calibration.zero_lsb[a]));
    }
  }
  if (has_doubles) {
    return validate(stored);
  }
  SIXPOINT_ASSIGN(record.calibration, calibration_from(stored));
  return {};
}

Result<CrossAxisMap> read_cross_axis(const Json& json) {
  const std::string where = "constants.json, cross_axis";
  const auto evidence = json.find("unseen_mg");
  const auto verified = json.find("verified");
  if (!json.is_object() || evidence == json.end() || !evidence->is_object() ||
      !evidence->contains("matrix") || !evidence->contains("six") ||
      !evidence->contains("directions") || verified == json.end() || !verified->is_boolean()) {
    return bad_record("is not whole: it needs terms, constants and the evidence for them", where);
  }
  CrossAxisMap map;
  SIXPOINT_ASSIGN(map.cross_axis, read_axes<double>(json, "xy_xz_yz"));
  SIXPOINT_ASSIGN(map.cross_axis_sd, read_uncertainties(json, "standard_uncertainty"));
  SIXPOINT_ASSIGN(map.calibration.sensitivity_g_per_lsb,
                  read_axes<double>(json, "sensitivity_g_per_lsb"));
  SIXPOINT_ASSIGN(map.calibration.zero_lsb, read_axes<double>(json, "zero_lsb"));
  SIXPOINT_ASSIGN(map.uncertainty.sensitivity_relative,
                  read_uncertainties(json, "sensitivity_relative_uncertainty"));
  SIXPOINT_ASSIGN(map.uncertainty.zero_mg, read_uncertainties(json, "zero_mg_uncertainty"));
  SIXPOINT_ASSIGN(map.unseen_mg, read_number((*evidence)["matrix"], where));
  SIXPOINT_ASSIGN(map.six_unseen_mg, read_number((*evidence)["six"], where));
  SIXPOINT_ASSIGN(const double directions, read_number((*evidence)["directions"], where));
  map.unseen_directions = static_cast<int>(std::clamp(directions, 0.0, 1e6));
  map.verified = verified->get<bool>();
  SIXPOINT_CHECK(validate(map));
  return map;
}

}  // namespace

std::string_view to_string(FilterConfiguration filter) {
  return filter == FilterConfiguration::legacy ? "legacy" : "current";
}

Result<FilterConfiguration> parse_filter_configuration(std::string_view text) {
  if (text == "legacy") {
    return FilterConfiguration::legacy;
  }
  if (text == "current") {
    return FilterConfiguration::current;
  }
  return fail(ErrorCode::usage, fmt::format("unknown filter configuration '{}'", text), "",
              "use 'legacy' or 'current'");
}

Status validate(const StoredConstants& stored) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    for (const int value : {stored.positive_lsb[a], stored.negative_lsb[a], stored.zero_lsb[a]}) {
      if (value < kStoredConstantMin || value > kStoredConstantMax) {
        return bad_constants(fmt::format("{} axis: {} LSB is outside [{}, {}]", kAxisNames[a],
                                         value, kStoredConstantMin, kStoredConstantMax));
      }
    }
    if (stored.positive_lsb[a] <= stored.negative_lsb[a]) {
      return bad_constants(fmt::format(
          "{} axis: the reading at +1 g ({} LSB) is not above the reading at -1 g ({} LSB)",
          kAxisNames[a], stored.positive_lsb[a], stored.negative_lsb[a]));
    }
  }
  return {};
}

Status validate(const Calibration& calibration) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double sensitivity = calibration.sensitivity_g_per_lsb[a];
    const double zero = calibration.zero_lsb[a];
    // Written so that NaN fails.
    if (!(sensitivity >= kMinSensitivity && sensitivity <= kMaxSensitivity)) {
      return bad_constants(fmt::format("{} axis: a sensitivity of {} g per LSB is impossible",
                                       kAxisNames[a], sensitivity));
    }
    if (!(std::abs(zero) <= kMaxZero_lsb)) {
      return bad_constants(
          fmt::format("{} axis: a zero of {} LSB is impossible", kAxisNames[a], zero));
    }
  }
  return {};
}

std::string why_no_sensor(const Calibration& calibration) {
  constexpr double kLeast_lsb_per_g = 150;
  constexpr double kMost_lsb_per_g = 350;
  constexpr double kMostZero_g = 0.75;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double lsb_per_g = 1 / calibration.sensitivity_g_per_lsb[a];
    const double zero_g = calibration.zero_lsb[a] * calibration.sensitivity_g_per_lsb[a];
    // Written so that NaN fails.
    if (!(lsb_per_g >= kLeast_lsb_per_g && lsb_per_g <= kMost_lsb_per_g)) {
      return fmt::format("no sensor of these units has {:.4g} LSB/g on its {} axis ({} to {})",
                         lsb_per_g, kAxisNames[a], kLeast_lsb_per_g, kMost_lsb_per_g);
    }
    if (!(std::abs(zero_g) <= kMostZero_g)) {
      return fmt::format(
          "no sensor of these units has a zero of {:.3g} g on its {} axis (within {})", zero_g,
          kAxisNames[a], kMostZero_g);
    }
  }
  return {};
}

Status validate(const CrossAxisMap& map) {
  constexpr double kMostTerm = 0.2;
  SIXPOINT_CHECK(validate(map.calibration));
  for (const double term : map.cross_axis) {
    // Written so that NaN fails.
    if (!(std::abs(term) <= kMostTerm)) {
      return bad_constants(fmt::format("a cross-axis term of {} is impossible", term));
    }
  }
  if (!all_finite(map.cross_axis_sd, map.uncertainty.sensitivity_relative, map.uncertainty.zero_mg,
                  map.unseen_mg, map.six_unseen_mg)) {
    return bad_constants("the uncertainty of the cross-axis terms is not finite");
  }
  return {};
}

Result<Calibration> calibration_from(const StoredConstants& stored) {
  SIXPOINT_CHECK(validate(stored));
  Calibration calibration;
  for (std::size_t a = 0; a < kAxes; ++a) {
    calibration.sensitivity_g_per_lsb[a] = 2.0 / (stored.positive_lsb[a] - stored.negative_lsb[a]);
    calibration.zero_lsb[a] = stored.zero_lsb[a];
  }
  return calibration;
}

Result<StoredConstants> nearest_stored(const Calibration& calibration) {
  SIXPOINT_CHECK(validate(calibration));
  StoredConstants stored;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double half = 1.0 / calibration.sensitivity_g_per_lsb[a];
    const auto span = static_cast<int>(std::lround(2 * half));
    stored.zero_lsb[a] = static_cast<int>(std::lround(calibration.zero_lsb[a]));
    stored.negative_lsb[a] = static_cast<int>(std::lround(calibration.zero_lsb[a] - half));
    stored.positive_lsb[a] = stored.negative_lsb[a] + span;
  }
  SIXPOINT_CHECK(validate(stored));
  return stored;
}

std::string ConstantsRecord::brief() const {
  std::string line = fmt::format("{} ({} filter), {}:", serial, to_string(filter), method);
  for (std::size_t a = 0; a < kAxes; ++a) {
    line += fmt::format(" {} {:.2f} LSB/g zero {:.2f} LSB{}", kAxisNames[a],
                        1.0 / calibration.sensitivity_g_per_lsb[a], calibration.zero_lsb[a],
                        a + 1 < kAxes ? "," : "");
  }
  if (from_prior) {
    line += " (rests on a population prior)";
  }
  return line;
}

Json number_or_null(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json to_json(const StoredConstants& stored) {
  return {{"positive_lsb", stored.positive_lsb},
          {"negative_lsb", stored.negative_lsb},
          {"zero_lsb", stored.zero_lsb}};
}

Json to_json(const Calibration& calibration) {
  return {{"sensitivity_g_per_lsb", calibration.sensitivity_g_per_lsb},
          {"zero_lsb", calibration.zero_lsb}};
}

Json to_json(const Calibration& calibration, const StoredConstants& stored) {
  Json json = to_json(calibration);
  json["positive_lsb"] = stored.positive_lsb;
  json["negative_lsb"] = stored.negative_lsb;
  // The unrounded zero above holds; the unit's memory takes this one.
  json["stored_zero_lsb"] = stored.zero_lsb;
  return json;
}

Json to_json(const ConstantsUncertainty& uncertainty) {
  const auto axes = [](const PerAxis<double>& values) {
    return Json::array(
        {number_or_null(values[0]), number_or_null(values[1]), number_or_null(values[2])});
  };
  return {{"sensitivity_relative", axes(uncertainty.sensitivity_relative)},
          {"zero_mg", axes(uncertainty.zero_mg)}};
}

Json to_json(const CrossAxisMap& map) {
  Json json;
  json["xy_xz_yz"] = map.cross_axis;
  json["standard_uncertainty"] = map.cross_axis_sd;
  json["sensitivity_g_per_lsb"] = map.calibration.sensitivity_g_per_lsb;
  json["zero_lsb"] = map.calibration.zero_lsb;
  json["sensitivity_relative_uncertainty"] = map.uncertainty.sensitivity_relative;
  json["zero_mg_uncertainty"] = map.uncertainty.zero_mg;
  json["unseen_mg"] = {
      {"six", map.six_unseen_mg}, {"matrix", map.unseen_mg}, {"directions", map.unseen_directions}};
  json["verified"] = map.verified;
  return json;
}

Json to_json(const ConstantsRecord& record) {
  Json json;
  json["serial"] = record.serial;
  json["filter"] = to_string(record.filter);
  json["constants"] = to_json(record.calibration, record.stored);
  json["standard_uncertainty"] = to_json(record.uncertainty);
  json["method"] = record.method;
  json["made_at"] = to_iso8601(record.made_at);
  json["made_from"]["sha256"] = record.made_from.sha256;
  if (!record.made_from.file.empty()) {
    json["made_from"]["file"] = record.made_from.file;
  }
  if (!record.made_from.station.empty()) {
    json["made_from"]["station"] = record.made_from.station;
  }
  if (!record.made_from.kind.empty()) {
    json["made_from"]["kind"] = record.made_from.kind;
  }
  json["gravity_m_per_s2"] = record.gravity_m_per_s2;
  if (record.from_prior) {
    json["from_prior"] = true;
  }
  if (record.cross_axis) {
    json["cross_axis"] = to_json(*record.cross_axis);
  }
  return json;
}

Result<ConstantsRecord> constants_record_from_json(const Json& json) {
  if (!json.is_object()) {
    return bad_record("is not a JSON object");
  }
  ConstantsRecord record;
  record.serial = read_text(json, "serial");
  if (record.serial.empty()) {
    return bad_record("names no serial number");
  }
  auto filter = parse_filter_configuration(read_text(json, "filter"));
  if (!filter) {
    return bad_record(filter.error().what, "constants.json, filter");
  }
  record.filter = *filter;
  const auto constants = json.find("constants");
  if (constants == json.end() || !constants->is_object()) {
    return bad_record("holds no constants");
  }
  SIXPOINT_CHECK(read_constants(*constants, record));
  if (const auto found = json.find("standard_uncertainty");
      found != json.end() && found->is_object()) {
    SIXPOINT_ASSIGN(record.uncertainty.sensitivity_relative,
                    read_uncertainties(*found, "sensitivity_relative"));
    SIXPOINT_ASSIGN(record.uncertainty.zero_mg, read_uncertainties(*found, "zero_mg"));
  }
  record.method = read_text(json, "method");
  if (const std::string made_at = read_text(json, "made_at"); !made_at.empty()) {
    SIXPOINT_ASSIGN(record.made_at, parse_iso8601(made_at));
  }
  if (const auto found = json.find("made_from"); found != json.end() && found->is_object()) {
    record.made_from = {read_text(*found, "sha256"), read_text(*found, "file"),
                        read_text(*found, "station"), read_text(*found, "kind")};
  }
  if (const auto found = json.find("gravity_m_per_s2"); found != json.end()) {
    const std::string where = "constants.json, gravity_m_per_s2";
    SIXPOINT_ASSIGN(record.gravity_m_per_s2, read_number(*found, where));
    if (record.gravity_m_per_s2 < 9.7 || record.gravity_m_per_s2 > 9.9) {
      return bad_record("is no gravity of this planet's surface", where);
    }
  }
  if (const auto found = json.find("from_prior"); found != json.end() && found->is_boolean()) {
    record.from_prior = found->get<bool>();
  }
  if (const auto found = json.find("cross_axis"); found != json.end() && !found->is_null()) {
    SIXPOINT_ASSIGN(record.cross_axis, read_cross_axis(*found));
  }
  return record;
}

Result<ConstantsRecord> parse_constants_record(std::string_view text) {
  constexpr std::size_t kLimit = 1U << 20;
  if (text.size() > kLimit) {
    return fail(ErrorCode::bad_data, "is too long for a constants file", "constants.json",
                "give a file written by 'sixpoint solve -o'");
  }
  const Json json = parse_json(text);
  if (json.is_discarded()) {
    return fail(ErrorCode::bad_data, "is not JSON: " + why_no_json(text), "constants.json",
                "give a file written by 'sixpoint solve -o'");
  }
  return constants_record_from_json(json);
}

}  // namespace sixpoint::calib
