// A little unit of the tests' own: what a sensor with known constants measures in given poses, and
// what its firmware stores. It shares no code with calib/, so that agreement means something.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "base/stored_constants.h"

namespace sixpoint::tests {

using Vector = std::array<double, 3>;
using Sample = std::array<std::int16_t, 3>;

struct SyntheticUnit {
  // The sensor as it is.
  Vector counts_per_g = {250.0, 252.0, 247.0};
  Vector zero_counts = {12.0, -20.0, 31.0};
  // What the firmware takes for true: positive, negative, zero.
  std::array<int, 3> positive = {300, 290, 280};
  std::array<int, 3> negative = {-210, -220, -230};
  std::array<int, 3> zero = {45, 35, 25};
  double accel_scale = 256;
  double noise_mg = 4.0;
  Vector cross_axis = {0, 0, 0};  // symmetric xy, xz, yz, as a fraction
  Vector drift_mg_per_c = {0, 0, 0};
  int limit = 2048;
};

inline Vector unit_vector(double x, double y, double z) {
  const double length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length};
}

inline Vector random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return unit_vector(normal(random), normal(random), normal(random));
}

// `direction` tilted by `angle_deg` towards a random side.
inline Vector wobbled(const Vector& direction, double angle_deg, std::mt19937_64& random) {
  const Vector other = random_direction(random);
  const double along = other[0] * direction[0] + other[1] * direction[1] + other[2] * direction[2];
  const Vector across =
      unit_vector(other[0] - along * direction[0], other[1] - along * direction[1],
                  other[2] - along * direction[2]);
  const double t = std::tan(angle_deg * M_PI / 180);
  return unit_vector(direction[0] + t * across[0], direction[1] + t * across[1],
                     direction[2] + t * across[2]);
}

inline int rounded(double value) {
  return static_cast<int>(value < 0 ? std::ceil(value - 0.5) : std::floor(value + 0.5));
}

// One sample of the acceleration `g` (in g, case frame) at `above_25_c` degrees.
inline std::array<int, 3> raw_sample(const SyntheticUnit& unit, const Vector& g,
                                     std::mt19937_64& random, double above_25_c = 0) {
  std::normal_distribution<double> noise(0.0, unit.noise_mg / 1000);
  const double xy = unit.cross_axis[0];
  const double xz = unit.cross_axis[1];
  const double yz = unit.cross_axis[2];
  const Vector mixed = {g[0] + xy * g[1] + xz * g[2], xy * g[0] + g[1] + yz * g[2],
                        xz * g[0] + yz * g[1] + g[2]};
  std::array<int, 3> raw{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double felt = mixed[a] + unit.drift_mg_per_c[a] * above_25_c / 1000 +
                        (unit.noise_mg > 0 ? noise(random) : 0.0);
    raw[a] = rounded(unit.zero_counts[a] + unit.counts_per_g[a] * felt);
  }
  return raw;
}

inline Sample stored_sample(const SyntheticUnit& unit, const std::array<int, 3>& raw) {
  Sample stored{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double scaled =
        2.0 * unit.accel_scale * (raw[a] - unit.zero[a]) / (unit.positive[a] - unit.negative[a]);
    int count = rounded(scaled);
    count = count < -unit.limit ? -unit.limit : count;
    count = count > unit.limit - 1 ? unit.limit - 1 : count;
    stored[a] = static_cast<std::int16_t>(count);
  }
  return stored;
}

// What a unit with these constants stores for a raw count of one axis.
inline std::int16_t firmware_count(const StoredConstants& stored, double accel_scale_lsb_per_g,
                                   std::size_t axis, int raw_lsb) {
  SyntheticUnit unit;
  unit.positive = stored.positive_lsb;
  unit.negative = stored.negative_lsb;
  unit.zero = stored.zero_lsb;
  unit.accel_scale = accel_scale_lsb_per_g;
  return stored_sample(unit, {raw_lsb, raw_lsb, raw_lsb})[axis];
}

// `seconds` at rest in one pose.
inline std::vector<Sample> at_rest(const SyntheticUnit& unit, const Vector& up, double seconds,
                                   double rate_hz, std::mt19937_64& random, double above_25_c = 0) {
  std::vector<Sample> samples;
  const int count = static_cast<int>(seconds * rate_hz);
  for (int i = 0; i < count; ++i) {
    samples.push_back(stored_sample(unit, raw_sample(unit, up, random, above_25_c)));
  }
  return samples;
}

// A turn of a person's hand from one pose to another: nothing in it is still.
inline std::vector<Sample> turning(const SyntheticUnit& unit, const Vector& from, const Vector& to,
                                   double seconds, double rate_hz, std::mt19937_64& random) {
  std::normal_distribution<double> shake(0.0, 0.15);
  std::vector<Sample> samples;
  const int count = static_cast<int>(seconds * rate_hz);
  for (int i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / count;
    Vector g{};
    for (std::size_t a = 0; a < 3; ++a) {
      g[a] = from[a] * (1 - t) + to[a] * t + shake(random);
    }
    samples.push_back(stored_sample(unit, raw_sample(unit, g, random)));
  }
  return samples;
}

}  // namespace sixpoint::tests
