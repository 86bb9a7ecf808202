#include "sim/sensor.h"

#include <algorithm>
#include <cmath>

namespace sixpoint::sim {

namespace {

constexpr double kNominal_lsb_per_g = 250;  // ADXL362 data sheet, range of 8 g

}  // namespace

PerAxis<int> Sensor::read(const Eigen::Vector3d& sensed_g) {
  PerAxis<int> raw{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double lsb =
        truth_.sensitivity_lsb_per_g[axis] * sensed_g[static_cast<Eigen::Index>(axis)] +
        truth_.zero_lsb[axis];
    const double limited_lsb = kNominal_lsb_per_g * format_.limited(lsb / kNominal_lsb_per_g);
    raw[axis] = static_cast<int>(std::round(std::clamp(limited_lsb, -2048.0, 2047.0)));
  }
  return raw;
}

}  // namespace sixpoint::sim
