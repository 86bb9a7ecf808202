// One effect of the catalogue alone: on a block of samples made by hand, or on a unit at rest.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

#include "sim/effects/effect.h"
#include "sim/simulator.h"

namespace sixpoint::tests {

// With the defaults of the catalogue for what is not given.
inline std::unique_ptr<sim::Effect> made_effect(const char* name,
                                                const sim::ParameterSet& given = {},
                                                std::uint64_t seed = 1) {
  const sim::EffectKind* kind = *sim::find_effect(name);
  return kind->make(*sim::complete_parameters(*kind, given), Random(seed));
}

// Samples every 1 / rate_hz from the start of the sample clock, at rest with z up, at 25 C. What is
// stored of sample i is (i + 1, 0, 0): neighbours differ, and none of the first 65535 is zero.
inline sim::SimulatedBlock made_block(std::size_t samples, double rate_hz = 100,
                                      double clock_start_s = 0) {
  sim::SimulatedBlock block;
  block.clock_start_s = clock_start_s;
  for (std::size_t i = 0; i < samples; ++i) {
    block.time_s.push_back(clock_start_s + static_cast<double>(i) / rate_hz);
    block.stored.push_back({static_cast<std::int16_t>(i + 1), 0, 0});
  }
  block.motion.assign(samples, {});
  block.true_g.assign(samples, Eigen::Vector3d::UnitZ());
  block.sensed_g = block.true_g;
  block.temperature_c.assign(samples, 25);
  block.raw_lsb.assign(samples, {});
  return block;
}

// What an effect on the sensor makes of one specific force.
inline Eigen::Vector3d sensed_under(sim::Effect& effect, const Eigen::Vector3d& force_g,
                                    double temperature_c = 25, double time_s = 0) {
  sim::SimulatedBlock block = made_block(1, 100, time_s);
  block.sensed_g[0] = force_g;
  block.temperature_c[0] = temperature_c;
  effect.on_sensor(block);
  return block.sensed_g[0];
}

// What is stored for this value in LSB, in 12 bits, under an effect on the number format.
inline double integer_under(const char* name, double value_lsb) {
  sim::NumberFormat format;
  made_effect(name)->on_digital(format);
  bool clipped = false;
  return format.to_integer(value_lsb, -2048, 2047, clipped);
}

// A unit without noise or error, whose counts are those of its sensor.
inline sim::UnitTruth unit_of_256_lsb_per_g() {
  sim::UnitTruth unit;
  unit.serial = "MOS2A45130007";
  unit.firmware = "1.5.0";
  unit.constants = {{256, 256, 256}, {-256, -256, -256}, {0, 0, 0}};
  unit.current = {{256, 256, 256}, {0, 0, 0}};
  unit.noise_mg = {};
  return unit;
}

// Two seconds at rest, with this direction up, of a unit without noise.
inline sim::SimulatedBlock run(const char* name, const sim::ParameterSet& given,
                               const Eigen::Vector3d& up, double temperature_c = 25) {
  sim::GivenProperties properties;
  properties.noise_mg = PerAxis<double>{};
  const sim::UnitTruth unit = sim::draw_unit(1, properties);
  std::vector<std::unique_ptr<sim::Effect>> effects;
  effects.push_back(made_effect(name, given));
  sim::SimulatorOptions options;
  options.rate_hz = 100;
  options.temperature_c = temperature_c;
  const auto motion = sim::still(sim::rotation_with_up(up));
  sim::Simulator simulator(unit, options, *motion, std::move(effects));
  sim::SimulatedBlock block;
  simulator.next(200, block);
  return block;
}

}  // namespace sixpoint::tests
