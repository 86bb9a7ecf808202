// Traces of units that were moved together, with a motion, a lag and a drift that are known.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "repair/compare/trace.h"

namespace sixpoint::tests {

// A motion known at every moment: gravity and a sum of swinging parts that come and go.
inline double motion_g(double time_s) {
  double value = 1;
  constexpr std::array<double, 4> kFrequencies_hz = {0.31, 0.83, 1.37, 2.11};
  for (std::size_t i = 0; i < kFrequencies_hz.size(); ++i) {
    const double swell = std::sin(2 * std::numbers::pi * time_s / (37.0 + 11.0 * double(i)) + 1);
    value += 0.1 * swell * swell *
             std::sin(2 * std::numbers::pi * kFrequencies_hz[i] * time_s + double(i));
  }
  return value;
}

struct MovedUnit {
  double rate_hz = 30;
  double lag_s = 0;      // what its clock shows, minus the truth, at time 0
  double drift_ppm = 0;  // its clock's
  double offset_g = 0;
  double noise_g = 0.002;
  std::uint64_t seed = 1;
};

inline repair::Trace recorded(const std::string& name, const MovedUnit& unit, double duration_s) {
  Random random(unit.seed);
  std::vector<float> magnitudes;
  const double start_s = 1'428'588'240;
  const auto count = static_cast<std::size_t>(duration_s * unit.rate_hz);
  for (std::size_t i = 0; i < count; ++i) {
    const double shown_s = static_cast<double>(i) / unit.rate_hz;
    const double true_s = (shown_s - unit.lag_s) / (1 + unit.drift_ppm * 1e-6);
    magnitudes.push_back(
        static_cast<float>(motion_g(true_s) + unit.offset_g + unit.noise_g * random.normal()));
  }
  return repair::Trace::from_magnitudes(name, start_s, unit.rate_hz, std::move(magnitudes));
}

}  // namespace sixpoint::tests
