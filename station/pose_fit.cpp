#include "station/pose_fit.h"

#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

// Seating of a placement on a careful jig, per axis: 0.01 degree.
constexpr double kSeating_g = 0.000175;

}  // namespace

Result<PoseFit> fit_poses(const std::vector<PoseReading>& faces, double gravity_g) {
  std::array<const PoseReading*, 6> by_pose{};
  for (const PoseReading& face : faces) {
    by_pose[static_cast<std::size_t>(face.pose)] = &face;
  }
  PoseFit fit;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const PoseReading* up = by_pose[static_cast<std::size_t>(device::pose_of(axis, 1))];
    const PoseReading* down = by_pose[static_cast<std::size_t>(device::pose_of(axis, -1))];
    double level_lsb = 0;
    double variance_lsb2 = 0;
    for (const PoseReading* face : by_pose) {
      if (face == nullptr) {
        return fail(ErrorCode::bad_data, "a face is missing", {}, "measure all six faces");
      }
      if (face != up && face != down) {
        level_lsb += face->mean_lsb[axis] / 4;
      }
      variance_lsb2 += face->sd_lsb[axis] * face->sd_lsb[axis] / face->samples / 6;
    }
    const double range_lsb = up->mean_lsb[axis] - down->mean_lsb[axis];
    if (!(range_lsb > 0)) {
      return fail(ErrorCode::bad_data,
                  fmt::format("the {} axis reads no more when it points up", kAxisNames[axis]), {},
                  "the sensor is faulty, or its axes are turned");
    }
    const double sensitivity_g_per_lsb = 2 * gravity_g / range_lsb;
    fit.paper.sensitivity_g_per_lsb[axis] = sensitivity_g_per_lsb;
    fit.paper.zero_lsb[axis] = level_lsb;
    fit.least_squares.sensitivity_g_per_lsb[axis] = sensitivity_g_per_lsb;
    fit.least_squares.zero_lsb[axis] =
        (up->mean_lsb[axis] + down->mean_lsb[axis] + 4 * level_lsb) / 6;
    const double reading_g =
        std::hypot(std::sqrt(variance_lsb2) * sensitivity_g_per_lsb, kSeating_g);
    fit.uncertainty.sensitivity_relative[axis] = reading_g / std::sqrt(2.0) / gravity_g;
    fit.uncertainty.zero_mg[axis] = reading_g / std::sqrt(6.0) * kMgPerG;
  }
  return fit;
}

Result<StoredConstants> round_for_unit(const calib::Calibration& calibration,
                                       const std::vector<PoseReading>& faces, double gravity_g) {
  SIXPOINT_ASSIGN(StoredConstants best, calib::nearest_stored(calibration));
  const StoredConstants nearest = best;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double least = std::numeric_limits<double>::infinity();
    for (const int zero : {-1, 0, 1}) {
      for (const int range : {-1, 0, 1}) {
        const int difference = nearest.positive_lsb[axis] - nearest.negative_lsb[axis] + range;
        const double sensitivity_g_per_lsb = 2.0 / difference;
        const int zero_lsb = nearest.zero_lsb[axis] + zero;
        double square = 0;
        for (const PoseReading& face : faces) {
          const double true_g = device::direction_of(face.pose)[axis] * gravity_g;
          const double error_g = sensitivity_g_per_lsb * (face.mean_lsb[axis] - zero_lsb) - true_g;
          // Where the axis carries gravity its error is the magnitude's; level it hardly counts.
          square += (true_g != 0 ? 1.0 : 0.01) * error_g * error_g;
        }
        if (square < least) {
          least = square;
          best.zero_lsb[axis] = zero_lsb;
          best.negative_lsb[axis] = static_cast<int>(std::lround(zero_lsb - difference / 2.0));
          best.positive_lsb[axis] = best.negative_lsb[axis] + difference;
        }
      }
    }
  }
  SIXPOINT_CHECK(calib::validate(best));
  return best;
}

}  // namespace sixpoint::station
