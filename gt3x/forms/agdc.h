// What only .agdc files (CentrePoint Insight) hold: die temperatures in log.bin, and calibrations
// that the unit does not apply itself.
//
//   SIXPOINT_ASSIGN(const AgdcCalibration calibration, parse_agdc_calibration(json, 256));
//   const PerAxis<double> value_g = calibration.apply({-12, 5, 1024});  // raw counts
//
// In an .agdc file the samples (ACTIVITY3) are raw sensor counts. calibration.json says how they
// become g, per sample rate, in two forms: the six-point form of Eq. 1-6, and an offset with a
// symmetric sensitivity matrix ("calibrationMethod": 2), which is what the vendor applies.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "base/stored_constants.h"
#include "gt3x/log/samples.h"

namespace sixpoint::gt3x {

// One TEMPERATURE record (type 30): entries of a sensor's number and a 16-bit ADC reading.
struct TemperatureReading {
  std::optional<int> processor_adc;      // sensor 0
  std::optional<int> accelerometer_adc;  // sensor 1: the accelerometer's die
};
// bad_data when the payload is no whole number of entries.
Result<TemperatureReading> parse_temperature(std::span<const std::uint8_t> payload);

// temperature_calibration.json: two points of a straight line per sensor.
struct TemperatureCalibration {
  struct Point {
    double temperature_c = 0;
    double processor_adc = 0;
    double accelerometer_adc = 0;
  };
  Point low, high;

  double processor_c(double adc) const;
  double accelerometer_c(double adc) const;
};
// bad_data for what is no JSON, lacks a value, or has two points that make no line.
Result<TemperatureCalibration> parse_temperature_calibration(std::string_view json);

struct AgdcCalibration {
  // "isCalibrated": the samples are in g times the file's scale. The file may then say nothing of what
  // stands below.
  bool already_applied = false;
  int method = 0;  // 2: the matrix holds
  PerAxis<double> offset_lsb{};
  // g per LSB, symmetric: g = sensitivity * (raw - offset).
  PerAxis<PerAxis<double>> sensitivity_g_per_lsb{};
  std::optional<StoredConstants> constants;  // the six-point form, where it is there

  PerAxis<double> apply(const Counts& raw_lsb) const;
  PerAxis<double> apply_to_mean(const PerAxis<double>& mean_lsb) const;  // of raw counts
};
// For one of the rates that the file knows (32, 64, 128, 256 Hz), or any where it was applied already;
// bad_data otherwise, for what is no such JSON, and for raw counts of a method other than 2: nothing
// public says how those become g.
Result<AgdcCalibration> parse_agdc_calibration(std::string_view json, int rate_hz);

}  // namespace sixpoint::gt3x
