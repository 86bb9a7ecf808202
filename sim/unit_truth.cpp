#include "sim/unit_truth.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/random.h"
#include "sim/firmware.h"

namespace sixpoint::sim {

namespace {

// Its own stream, so that a unit does not depend on how much noise was drawn before.
constexpr std::uint64_t kUnitStream = 0x756E6974;

int stored(double lsb) {
  return static_cast<int>(
      std::lround(std::clamp<double>(lsb, kStoredConstantMin, kStoredConstantMax)));
}

// The difference between the two configurations, and of the stored zero from the sensor's.
struct Drawn {
  std::uint64_t serial_number = 0;
  double age_days = 0;
  SensorTruth sensor;
  PerAxis<double> gain{};
  PerAxis<double> offset_g{};
  PerAxis<double> zero_error_lsb{};
};

// Every number is drawn whether it is given or not: a given one changes only what it names.
Drawn draw(std::uint64_t seed) {
  Random random(seed, kUnitStream);
  const auto sign = [&] { return random.uniform() < 0.5 ? -1 : 1; };
  Drawn out;
  out.serial_number = random.below(10'000);
  out.age_days = random.uniform(0, 135);  // 2013-11-07 to 2014-03-22
  const double common_gain = random.uniform(0.80, 0.95);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    out.sensor.sensitivity_lsb_per_g[axis] =
        262 * (1 + 0.02 * std::clamp(random.normal(), -2.5, 2.5));
    out.sensor.zero_lsb[axis] = 40 + 20 * std::clamp(random.normal(), -2.5, 2.5);
    out.gain[axis] = common_gain * (1 + 0.01 * std::clamp(random.normal(), -2.0, 2.0));
    out.offset_g[axis] = random.uniform(0.1, 0.2);
    out.offset_g[axis] *= sign();
    out.zero_error_lsb[axis] = random.uniform(2, 7);
    out.zero_error_lsb[axis] *= sign();
  }
  return out;
}

SensorTruth legacy_to_current(const SensorTruth& from, const Drawn& drawn) {
  SensorTruth to;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    to.sensitivity_lsb_per_g[axis] = from.sensitivity_lsb_per_g[axis] * drawn.gain[axis];
    to.zero_lsb[axis] =
        from.zero_lsb[axis] + drawn.offset_g[axis] * from.sensitivity_lsb_per_g[axis];
  }
  return to;
}

SensorTruth current_to_legacy(const SensorTruth& from, const Drawn& drawn) {
  SensorTruth to;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    to.sensitivity_lsb_per_g[axis] = from.sensitivity_lsb_per_g[axis] / drawn.gain[axis];
    to.zero_lsb[axis] = from.zero_lsb[axis] - drawn.offset_g[axis] * to.sensitivity_lsb_per_g[axis];
  }
  return to;
}

void replace(SensorTruth& sensor, const std::optional<PerAxis<double>>& sensitivity_lsb_per_g,
             const std::optional<PerAxis<double>>& zero_lsb) {
  sensor.sensitivity_lsb_per_g = sensitivity_lsb_per_g.value_or(sensor.sensitivity_lsb_per_g);
  sensor.zero_lsb = zero_lsb.value_or(sensor.zero_lsb);
}

// The sensor under the configuration of its constants, as far as given constants determine it.
SensorTruth sensor_of_constants(const GivenProperties& given, const Drawn& drawn) {
  SensorTruth out = drawn.sensor;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double& sensitivity = out.sensitivity_lsb_per_g[axis];
    double& zero = out.zero_lsb[axis];
    if (given.positive_lsb && given.negative_lsb) {
      sensitivity = ((*given.positive_lsb)[axis] - (*given.negative_lsb)[axis]) / 2.0;
      zero = ((*given.positive_lsb)[axis] + (*given.negative_lsb)[axis]) / 2.0;
    } else if (given.positive_lsb) {
      zero = (*given.positive_lsb)[axis] - sensitivity;
    } else if (given.negative_lsb) {
      zero = (*given.negative_lsb)[axis] + sensitivity;
    } else if (given.zero_lsb) {
      zero = (*given.zero_lsb)[axis] + drawn.zero_error_lsb[axis];
    }
  }
  return out;
}

StoredConstants constants_of(const SensorTruth& sensor, const GivenProperties& given,
                             const Drawn& drawn) {
  StoredConstants out;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double zero = sensor.zero_lsb[axis];
    const double sensitivity = sensor.sensitivity_lsb_per_g[axis];
    out.positive_lsb[axis] = stored(zero + sensitivity);
    out.negative_lsb[axis] = stored(zero - sensitivity);
    out.zero_lsb[axis] = stored(zero - drawn.zero_error_lsb[axis]);
  }
  out.positive_lsb = given.positive_lsb.value_or(out.positive_lsb);
  out.negative_lsb = given.negative_lsb.value_or(out.negative_lsb);
  out.zero_lsb = given.zero_lsb.value_or(out.zero_lsb);
  return out;
}

}  // namespace

UnitTruth draw_unit(std::uint64_t seed, const GivenProperties& given) {
  const Drawn drawn = draw(seed);
  UnitTruth unit;
  unit.serial = given.serial.value_or(fmt::format("MOS2A4513{:04}", drawn.serial_number));
  unit.firmware = given.firmware.value_or("1.5.0");
  unit.calibrated = given.calibrated.value_or(
      from_unix_seconds(1'383'782'400 + static_cast<std::int64_t>(drawn.age_days * 86'400)));
  unit.noise_mg = given.noise_mg.value_or(unit.noise_mg);
  unit.accel_scale_lsb_per_g = given.accel_scale_lsb_per_g.value_or(unit.accel_scale_lsb_per_g);

  SensorTruth own = sensor_of_constants(given, drawn);
  const bool legacy_constants =
      filter_of_constants(unit.serial, unit.calibrated) == FilterConfiguration::legacy;
  if (legacy_constants) {
    replace(own, given.legacy_sensitivity_lsb_per_g, given.legacy_zero_lsb);
  } else {
    replace(own, given.current_sensitivity_lsb_per_g, given.current_zero_lsb);
  }
  unit.constants = constants_of(own, given, drawn);
  unit.legacy = legacy_constants ? own : current_to_legacy(own, drawn);
  unit.current = legacy_constants ? legacy_to_current(own, drawn) : own;
  replace(unit.legacy, given.legacy_sensitivity_lsb_per_g, given.legacy_zero_lsb);
  replace(unit.current, given.current_sensitivity_lsb_per_g, given.current_zero_lsb);
  return unit;
}

}  // namespace sixpoint::sim
