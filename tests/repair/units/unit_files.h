// Files of one unit that lay still in some directions only. Motion, sensor and firmware are written
// out in six_sides.h and made_recording.h; what is under test shares no code with them.
#pragma once

#include <cmath>
#include <string>

#include "repair/six_sides.h"

namespace sixpoint::tests {

// Ten seconds in each of `poses` directions in which `axis` has the sign of `sign`; the zeros stand
// `shift_mg` beside kTrue (another temperature, or another unit).
inline MadeRecording half_sphere(std::size_t axis, int sign, std::uint64_t seed, int poses = 15,
                                 const PerAxis<double>& shift_mg = {}) {
  MadeRecording made;
  made.start += static_cast<std::uint32_t>(seed) * 100'000;
  Random random(seed);
  for (int pose = 0; pose < poses; ++pose) {
    PerAxis<double> up = {random.normal(), random.normal(), random.normal()};
    up[axis] = sign * std::abs(up[axis]);
    const double length = std::hypot(up[0], up[1], up[2]);
    for (int i = 0; i < 300; ++i) {
      PerAxis<double> g{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        g[a] = up[a] / length + shift_mg[a] / 1000 + 0.004 * random.normal();
      }
      made.raw.push_back(sense(g));
    }
  }
  return made;
}

}  // namespace sixpoint::tests
