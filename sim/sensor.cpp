#include "sim/sensor.h"

#include <algorithm>
#include <cmath>

namespace sixpoint::sim {

PerAxis<int> Sensor::read(const Eigen::Vector3d& sensed_g) {
  PerAxis<int> raw{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double lsb = truth_.sensitivity_lsb_per_g[axis] * sensed_g[static_cast<Eigen::Index>(axis)] +
                 truth_.zero_lsb[axis];
    if (std::isfinite(format_.limit_g)) {
      // Stored g to raw counts: Eq. 4-6 the other way round.
      const double limit_lsb = format_.limit_g * lsb_per_stored_g_[axis];
      lsb = std::clamp(lsb, stored_zero_lsb_[axis] - limit_lsb, stored_zero_lsb_[axis] + limit_lsb);
    }
    // What wraps is the stored number: it has to come that far.
    lsb = format_.wraps ? std::clamp(lsb, -32768.0, 32767.0) : std::clamp(lsb, -2048.0, 2047.0);
    raw[axis] = static_cast<int>(std::round(lsb));
  }
  return raw;
}

}  // namespace sixpoint::sim
