// A unit as it really is: its sensor under each filter configuration, and what its memory holds.
//
//   GivenProperties given;
//   given.firmware = "1.9.2";
//   const UnitTruth unit = draw_unit(seed, given);
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/measure.h"
#include "base/stored_constants.h"
#include "base/time.h"
#include "calib/constants.h"

namespace sixpoint::sim {

using calib::FilterConfiguration;

// raw = sensitivity * acceleration + zero, in raw counts of the ADXL362 (12 bits).
struct SensorTruth {
  PerAxis<double> sensitivity_lsb_per_g{};
  PerAxis<double> zero_lsb{};

  bool operator==(const SensorTruth&) const = default;
};

struct UnitTruth {
  std::string serial;
  std::string firmware;
  UtcTime calibrated{};
  StoredConstants constants;  // in the unit's memory
  SensorTruth legacy;
  SensorTruth current;
  // White noise, standard deviation per sample at 100 Hz: ADXL362 at this bandwidth, and what still
  // periods of real recordings show; z is the noisier axis by design.
  PerAxis<double> noise_mg = {3.9, 3.9, 5.5};
  double accel_scale_lsb_per_g = 256;  // MOS and TAS units

  const SensorTruth& sensor(FilterConfiguration filter) const {
    return filter == FilterConfiguration::legacy ? legacy : current;
  }
};

// What is given of a unit; the rest is drawn.
struct GivenProperties {
  std::optional<std::string> serial;
  std::optional<std::string> firmware;
  std::optional<UtcTime> calibrated;
  std::optional<PerAxis<int>> positive_lsb;
  std::optional<PerAxis<int>> negative_lsb;
  std::optional<PerAxis<int>> zero_lsb;
  std::optional<PerAxis<double>> current_sensitivity_lsb_per_g;
  std::optional<PerAxis<double>> current_zero_lsb;
  std::optional<PerAxis<double>> legacy_sensitivity_lsb_per_g;
  std::optional<PerAxis<double>> legacy_zero_lsb;
  std::optional<PerAxis<double>> noise_mg;
  std::optional<double> accel_scale_lsb_per_g;
};

// A plausible unit for this seed, the same on every machine.
//
// Sensitivity 262 LSB/g with 2 % between axes, zero 40 LSB with 20 LSB scatter (readings of real
// units' PARAMETERS). `current` against `legacy`: a common gain of 0.80 to 0.95 and offsets of 0.1
// to 0.2 g of either sign (what affected recordings show). The stored constants are those of the
// configuration that was used on the calibration date, rounded, with zero measured apart: in real
// units it lies 2 to 7 LSB off the midpoint of positive and negative. Where constants are given
// and the sensor is not, the sensor under the constants' own configuration is what they say:
// sensitivity from their difference, zero from their midpoint.
UnitTruth draw_unit(std::uint64_t seed, const GivenProperties& given = {});

}  // namespace sixpoint::sim
