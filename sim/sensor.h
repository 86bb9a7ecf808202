// The accelerometer: specific force in, raw counts out.
#pragma once

#include <Eigen/Core>

#include "base/random.h"
#include "sim/unit_truth.h"

namespace sixpoint::sim {

// Noise is white and Gaussian, drawn at every sample; readings are rounded to the nearest count and
// clipped to the ADXL362's 12 bits. One object belongs to one thread.
class Sensor {
 public:
  Sensor(const UnitTruth& unit, FilterConfiguration filter, Random noise)
      : truth_(unit.sensor(filter)), noise_(noise) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      noise_lsb_[axis] = unit.noise_mg[axis] / kMgPerG * truth_.sensitivity_lsb_per_g[axis];
    }
  }
  PerAxis<int> read(const Eigen::Vector3d& sensed_g);

 private:
  SensorTruth truth_;
  PerAxis<double> noise_lsb_{};
  Random noise_;
};

}  // namespace sixpoint::sim
