// Gain, zero and cross-axis terms of a sensor of unknown unit from its readings at rest: the length
// of every vector must be gravity.
//
//   SIXPOINT_ASSIGN(const LengthFit fit, fit_lengths(means, 9.81));  // counts, m/s2
//   const double x_m_per_s2 = fit.sensitivity(0, 0);                 // per count
//
// The fit is calib::least_squares(), on readings brought to about 1 and back.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "base/result.h"

namespace sixpoint::gap {

enum class CrossAxis { none, symmetric };

struct LengthFit {
  Eigen::Matrix3d sensitivity;  // symmetric: g = sensitivity * (raw - zero)
  Eigen::Vector3d zero;
  Eigen::Vector3d cross;  // yz xz xy: off-diagonal over the mean of the two diagonal terms
  Eigen::Vector3d cross_sd;
  double residual = 0;  // rms of length less gravity
};

// `raw` in any unit that is linear in acceleration, one row per position; `gravity` in the unit
// wanted. Nine parameters, or six without the cross-axis terms. Only the symmetric part of the
// cross-axis terms is found, since a rotation does not change lengths. bad_data for fewer than
// twelve positions, or directions that do not determine the parameters.
Result<LengthFit> fit_lengths(const std::vector<Eigen::Vector3d>& raw, double gravity,
                              CrossAxis cross_axis = CrossAxis::symmetric);

}  // namespace sixpoint::gap
