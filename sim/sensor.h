// The accelerometer: specific force in, raw counts out.
//
//   Sensor sensor(draw_unit(7), FilterConfiguration::current, Random(7, 1));
//   Eigen::Vector3d sensed_g(0, 0, 1);
//   sensor.add_noise(sensed_g);
//   const PerAxis<int> raw_lsb = sensor.read(sensed_g);
#pragma once

#include <Eigen/Core>
#include <cstdlib>

#include "base/random.h"
#include "sim/effects/effect.h"
#include "sim/unit_truth.h"

namespace sixpoint::sim {

// Noise is white and Gaussian, drawn at every sample, and felt before the front end does what it
// does (Effect::on_analog); readings are rounded to the nearest count and clipped to the ADXL362's
// 12 bits (to 16 where the format wraps), or below, where the stored constants make the format's
// limit of them. One object belongs to one thread.
class Sensor {
 public:
  Sensor(const UnitTruth& unit, FilterConfiguration filter, Random noise,
         const NumberFormat& format = {})
      : truth_(unit.sensor(filter)), noise_(noise), format_(format) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      noise_g_[axis] = unit.noise_mg[axis] / kMgPerG;
      lsb_per_stored_g_[axis] =
          std::abs(unit.constants.positive_lsb[axis] - unit.constants.negative_lsb[axis]) / 2.0;
      stored_zero_lsb_[axis] = unit.constants.zero_lsb[axis];
    }
  }
  void add_noise(Eigen::Vector3d& sensed_g) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      sensed_g[static_cast<Eigen::Index>(axis)] += noise_g_[axis] * noise_.normal();
    }
  }
  PerAxis<int> read(const Eigen::Vector3d& sensed_g);

 private:
  SensorTruth truth_;
  PerAxis<double> noise_g_{};
  PerAxis<double> lsb_per_stored_g_{};
  PerAxis<double> stored_zero_lsb_{};
  Random noise_;
  NumberFormat format_;
};

}  // namespace sixpoint::sim
