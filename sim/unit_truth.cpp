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

}  // namespace

UnitTruth draw_unit(std::uint64_t seed, const UnitWishes& wishes) {
  Random random(seed, kUnitStream);
  UnitTruth unit;

  // Every number is drawn whether it is wished for or not: a wish changes only what it names.
  const auto serial_number = random.below(10'000);
  const double age_days = random.uniform(0, 135);  // 2013-11-07 to 2014-03-22
  SensorTruth legacy;
  PerAxis<double> gain{};
  PerAxis<double> offset_g{};
  PerAxis<double> zero_error_lsb{};
  const double common_gain = random.uniform(0.80, 0.95);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    legacy.sensitivity_lsb_per_g[axis] = 262 * (1 + 0.02 * std::clamp(random.normal(), -2.5, 2.5));
    legacy.zero_lsb[axis] = 40 + 20 * std::clamp(random.normal(), -2.5, 2.5);
    gain[axis] = common_gain * (1 + 0.01 * std::clamp(random.normal(), -2.0, 2.0));
    offset_g[axis] = random.uniform(0.1, 0.2) * (random.uniform() < 0.5 ? -1 : 1);
    zero_error_lsb[axis] = random.uniform(2, 7) * (random.uniform() < 0.5 ? -1 : 1);
  }

  unit.serial = wishes.serial.value_or(fmt::format("MOS2A4513{:04}", serial_number));
  unit.firmware = wishes.firmware.value_or("1.5.0");
  unit.calibrated = wishes.calibrated.value_or(
      from_unix_seconds(1'383'782'400 + static_cast<std::int64_t>(age_days * 86'400)));
  unit.noise_mg = wishes.noise_mg.value_or(unit.noise_mg);
  unit.accel_scale_lsb_per_g = wishes.accel_scale_lsb_per_g.value_or(unit.accel_scale_lsb_per_g);

  const FilterConfiguration own = filter_of_constants(unit.serial, unit.calibrated);
  const bool legacy_constants = own == FilterConfiguration::legacy;
  const auto apply_gain = [&](const SensorTruth& from, double direction) {
    SensorTruth to;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (direction > 0) {
        to.sensitivity_lsb_per_g[axis] = from.sensitivity_lsb_per_g[axis] * gain[axis];
        to.zero_lsb[axis] = from.zero_lsb[axis] + offset_g[axis] * from.sensitivity_lsb_per_g[axis];
      } else {
        to.sensitivity_lsb_per_g[axis] = from.sensitivity_lsb_per_g[axis] / gain[axis];
        to.zero_lsb[axis] = from.zero_lsb[axis] - offset_g[axis] * to.sensitivity_lsb_per_g[axis];
      }
    }
    return to;
  };

  // The sensor under the configuration of its constants: what is wished for it, else what wished
  // constants say, else what was drawn.
  const auto& own_sensitivity =
      legacy_constants ? wishes.legacy_sensitivity_lsb_per_g : wishes.current_sensitivity_lsb_per_g;
  const auto& own_zero = legacy_constants ? wishes.legacy_zero_lsb : wishes.current_zero_lsb;
  SensorTruth own_sensor = legacy;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double& sensitivity = own_sensor.sensitivity_lsb_per_g[axis];
    double& zero = own_sensor.zero_lsb[axis];
    if (wishes.positive_lsb && wishes.negative_lsb) {
      sensitivity = ((*wishes.positive_lsb)[axis] - (*wishes.negative_lsb)[axis]) / 2.0;
      zero = ((*wishes.positive_lsb)[axis] + (*wishes.negative_lsb)[axis]) / 2.0;
    } else if (wishes.positive_lsb) {
      zero = (*wishes.positive_lsb)[axis] - sensitivity;
    } else if (wishes.negative_lsb) {
      zero = (*wishes.negative_lsb)[axis] + sensitivity;
    } else if (wishes.zero_lsb) {
      zero = (*wishes.zero_lsb)[axis] + zero_error_lsb[axis];
    }
    if (own_sensitivity) {
      sensitivity = (*own_sensitivity)[axis];
    }
    if (own_zero) {
      zero = (*own_zero)[axis];
    }
    unit.constants.positive_lsb[axis] =
        wishes.positive_lsb ? (*wishes.positive_lsb)[axis] : stored(zero + sensitivity);
    unit.constants.negative_lsb[axis] =
        wishes.negative_lsb ? (*wishes.negative_lsb)[axis] : stored(zero - sensitivity);
    unit.constants.zero_lsb[axis] =
        wishes.zero_lsb ? (*wishes.zero_lsb)[axis] : stored(zero - zero_error_lsb[axis]);
  }

  unit.legacy = legacy_constants ? own_sensor : apply_gain(own_sensor, -1);
  unit.current = legacy_constants ? apply_gain(own_sensor, +1) : own_sensor;
  const auto wish = [](PerAxis<double>& value, const std::optional<PerAxis<double>>& wished) {
    value = wished.value_or(value);
  };
  wish(unit.legacy.sensitivity_lsb_per_g, wishes.legacy_sensitivity_lsb_per_g);
  wish(unit.legacy.zero_lsb, wishes.legacy_zero_lsb);
  wish(unit.current.sensitivity_lsb_per_g, wishes.current_sensitivity_lsb_per_g);
  wish(unit.current.zero_lsb, wishes.current_zero_lsb);
  return unit;
}

}  // namespace sixpoint::sim
