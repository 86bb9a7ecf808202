// A recording of a unit that lay on each of its six sides and was moved, with known constants.
#pragma once

#include <array>
#include <cmath>

#include "base/random.h"
#include "calib/constants.h"
#include "repair/made_recording.h"

namespace sixpoint::tests {

// What the sensor really is under `current`; the stored constants are 0.1 to 0.2 g off it.
inline const calib::Calibration kTrue = {{1 / 237.7, 1 / 251.8, 1 / 242.3}, {95.2, 52.3, 90.8}};

inline PerAxis<int> sense(const PerAxis<double>& g) {
  PerAxis<int> raw{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    raw[a] =
        static_cast<int>(std::lround(g[a] / kTrue.sensitivity_g_per_lsb[a] + kTrue.zero_lsb[a]));
  }
  return raw;
}

// Six sides of ten seconds and ten seconds of movement.
inline MadeRecording six_sides() {
  MadeRecording made;
  Random random(3);
  for (int side = 0; side < 7; ++side) {
    for (int i = 0; i < 300; ++i) {
      PerAxis<double> g{};
      if (side < 6) {
        g[static_cast<std::size_t>(side / 2)] = side % 2 == 0 ? 1 : -1;
      } else {
        g = {2 * std::sin(i * 0.2), 1.5 * std::cos(i * 0.3), 6 * std::sin(i * 0.1)};
      }
      for (double& value : g) {
        value += 0.004 * random.normal();
      }
      made.raw.push_back(sense(g));
    }
  }
  return made;
}

// The same unit at rest for ten seconds in each of thirty directions: its still periods suffice.
inline MadeRecording many_sides(std::uint64_t seed = 5) {
  MadeRecording made;
  Random random(seed);
  for (int pose = 0; pose < 30; ++pose) {
    PerAxis<double> up = {random.normal(), random.normal(), random.normal()};
    const double length = std::hypot(up[0], up[1], up[2]);
    for (int i = 0; i < 300; ++i) {
      PerAxis<double> g{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        g[a] = up[a] / length + 0.004 * random.normal();
      }
      made.raw.push_back(sense(g));
    }
  }
  return made;
}

// What that unit stores on each of its sides when nothing moves and nothing is noisy.
inline std::array<gt3x::Counts, 6> stored_sides() {
  std::array<gt3x::Counts, 6> sides{};
  for (std::size_t side = 0; side < sides.size(); ++side) {
    PerAxis<double> g{};
    g[side / 2] = side % 2 == 0 ? 1 : -1;
    sides[side] = MadeRecording::store(kStored, sense(g), false);
  }
  return sides;
}

}  // namespace sixpoint::tests
