#include "gt3x/forms/agdc.h"

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace sixpoint::gt3x {
namespace {

using Json = nlohmann::json;

tl::unexpected<Error> not_a_calibration(const std::string& what) {
  return fail(ErrorCode::bad_data, what, {},
              "take calibration.json from an undamaged copy of the file");
}

Result<Json> parse_object(std::string_view text) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) {
    text.remove_prefix(kByteOrderMark.size());
  }
  if (text.size() > (1U << 20)) {
    return not_a_calibration("the calibration is larger than one can be");
  }
  // Depth is what a hostile JSON text can hurt with; a calibration has one level.
  const Json::parser_callback_t shallow = [](int depth, Json::parse_event_t, Json&) {
    return depth < 4;
  };
  Json json = Json::parse(text, shallow, false);
  if (!json.is_object()) {
    return not_a_calibration("the calibration is no JSON object");
  }
  return json;
}

Result<double> number_at(const Json& json, const std::string& key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number() || !std::isfinite(found->get<double>())) {
    return not_a_calibration(fmt::format("the calibration says nothing of {}", key));
  }
  return found->get<double>();
}

// Offset, matrix and the six-point form of one rate.
Status read_coefficients(const Json& json, int rate_hz, AgdcCalibration& calibration) {
  const auto value = [&](std::string_view name) {
    return number_at(json, fmt::format("{}_{}", name, rate_hz));
  };
  constexpr std::string_view kAxis = "XYZ";
  StoredConstants constants;
  bool six_point = true;
  for (std::size_t row = 0; row < kAxes; ++row) {
    SIXPOINT_ASSIGN(calibration.offset_lsb[row], value(fmt::format("offset{}", kAxis[row])));
    for (std::size_t column = row; column < kAxes; ++column) {
      SIXPOINT_ASSIGN(const double stored,
                      value(fmt::format("sensitivity{}{}", kAxis[row], kAxis[column])));
      // Stored in hundredths of LSB per g; off the diagonal as the distance of the reciprocal from
      // that of 250 LSB/g (as the vendor's public reader decodes it).
      const double lsb_per_g = stored * 0.01 + (row == column ? 0 : 250);
      if (lsb_per_g == 0) {
        return not_a_calibration("the calibration holds a sensitivity of 0");
      }
      const double g_per_lsb = 1 / lsb_per_g - (row == column ? 0 : 1.0 / 250);
      calibration.sensitivity_g_per_lsb[row][column] = g_per_lsb;
      calibration.sensitivity_g_per_lsb[column][row] = g_per_lsb;
    }
    const std::array<std::pair<const char*, PerAxis<int>*>, 3> nine = {{
        {"positiveZeroGOffset", &constants.positive_lsb},
        {"negativeZeroGOffset", &constants.negative_lsb},
        {"zeroGOffset", &constants.zero_lsb},
    }};
    for (const auto& [name, axes] : nine) {
      const auto stored = value(fmt::format("{}{}", name, kAxis[row]));
      six_point =
          six_point && stored && *stored >= kStoredConstantMin && *stored <= kStoredConstantMax;
      (*axes)[row] = six_point ? static_cast<int>(*stored) : 0;
    }
  }
  if (six_point) {
    calibration.constants = constants;
  }
  return {};
}

double on_line(double adc, double low_adc, double high_adc, double low, double high) {
  return low + (adc - low_adc) * (high - low) / (high_adc - low_adc);
}

}  // namespace

Result<TemperatureReading> parse_temperature(std::span<const std::uint8_t> payload) {
  constexpr std::size_t kEntry = 3;
  if (payload.empty() || payload.size() % kEntry != 0) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("a TEMPERATURE record of {} bytes is no list of readings", payload.size()), {},
        "download the recording from the unit again");
  }
  TemperatureReading reading;
  for (std::size_t at = 0; at < payload.size(); at += kEntry) {
    const int adc = static_cast<std::int16_t>(payload[at + 1] | (payload[at + 2] << 8));
    if (payload[at] == 0) {
      reading.processor_adc = adc;
    } else if (payload[at] == 1) {
      reading.accelerometer_adc = adc;
    }
  }
  return reading;
}

double TemperatureCalibration::processor_c(double adc) const {
  return on_line(adc, low.processor_adc, high.processor_adc, low.temperature_c, high.temperature_c);
}

double TemperatureCalibration::accelerometer_c(double adc) const {
  return on_line(adc, low.accelerometer_adc, high.accelerometer_adc, low.temperature_c,
                 high.temperature_c);
}

Result<TemperatureCalibration> parse_temperature_calibration(std::string_view text) {
  SIXPOINT_ASSIGN(const Json json, parse_object(text));
  TemperatureCalibration calibration;
  using Point = TemperatureCalibration::Point;
  for (const auto& [name, value] :
       {std::pair(std::string("temp"), &Point::temperature_c),
        std::pair(std::string("mcuTemp"), &Point::processor_adc),
        std::pair(std::string("adxlTemp"), &Point::accelerometer_adc)}) {
    SIXPOINT_ASSIGN(calibration.low.*value, number_at(json, name + "Low"));
    SIXPOINT_ASSIGN(calibration.high.*value, number_at(json, name + "High"));
  }
  if (calibration.low.processor_adc == calibration.high.processor_adc ||
      calibration.low.accelerometer_adc == calibration.high.accelerometer_adc) {
    return not_a_calibration("the two points of the temperature calibration are one");
  }
  return calibration;
}

PerAxis<double> AgdcCalibration::apply(const Counts& raw_lsb) const {
  return apply_to_mean({static_cast<double>(raw_lsb[0]), static_cast<double>(raw_lsb[1]),
                        static_cast<double>(raw_lsb[2])});
}

PerAxis<double> AgdcCalibration::apply_to_mean(const PerAxis<double>& mean_lsb) const {
  PerAxis<double> g{};
  for (std::size_t row = 0; row < kAxes; ++row) {
    for (std::size_t column = 0; column < kAxes; ++column) {
      g[row] += sensitivity_g_per_lsb[row][column] * (mean_lsb[column] - offset_lsb[column]);
    }
  }
  return g;
}

Result<AgdcCalibration> parse_agdc_calibration(std::string_view text, int rate_hz) {
  SIXPOINT_ASSIGN(const Json json, parse_object(text));
  AgdcCalibration calibration;
  calibration.already_applied = json.contains("isCalibrated") && json["isCalibrated"] == true;
  calibration.method =
      json.contains("calibrationMethod") && json["calibrationMethod"].is_number_integer()
          ? json["calibrationMethod"].get<int>()
          : 0;
  constexpr int kMatrix = 2;
  if (!calibration.already_applied && calibration.method != kMatrix) {
    return fail(ErrorCode::bad_data,
                fmt::format("a calibration by method {}, which is not public",
                            json.value("calibrationMethod", Json(nullptr)).dump()),
                {}, "export the raw counts with --raw");
  }
  const Status coefficients = read_coefficients(json, rate_hz, calibration);
  if (!coefficients && !calibration.already_applied) {
    return fail(coefficients.error());
  }
  return calibration;
}

}  // namespace sixpoint::gt3x
