// The jig: six poses of known direction, the paper's third method and the factory's procedure.
//
//   // used, held_out: means of still stretches (PoseMean)
//   SIXPOINT_ASSIGN(const SixPoseReport report, solve_six_poses(used, held_out));
//   if (report.usable()) {
//     const StoredConstants& constants = report.best().stored;
//   }
//
// Three solutions of the same readings are computed and reported. The one that does best on
// readings that were not used is chosen, and verified by other readings that were not used (of
// every axis the first unused reading chooses, all others verify):
//  - as_published: Eq. 1-3 as the paper has them. positive and negative are the readings at +1 g
//    and -1 g, zero is the mean reading of the four poses in which the axis lies level. Level
//    readings carry the tilt of jig and case in full (0.5 degrees are 9 mg). That is why zero is
//    not the midpoint of positive and negative in real units, and a freshly calibrated one reads up
//    to 27 mg wrong.
//  - per_axis: the least-squares sensitivity and zero of every axis over all poses, each reading
//    weighted by what noise and tilt do to it there. Tilt acts on an upright axis only in second
//    order, so this is nearly the midpoint.
//  - all_axes: all three axes against the pose's direction, m = zero + K g: sensitivities, zeros,
//    cross-axis terms and the rotation of the sensor in its case.
// Readings are in raw counts (LSB), directions are unit vectors in the case's frame. Gravity is the
// station's own; constants hold for standard gravity. Pure functions: any thread may call them.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/measure.h"
#include "base/result.h"
#include "calib/constants.h"
#include "calib/poses/gravity.h"

namespace sixpoint::calib {

// The six sides of the case: which axis of the case points up, "+x" first.
inline constexpr std::size_t kSides = 6;
inline constexpr std::array<std::string_view, kSides> kSideNames = {"+x", "-x", "+y",
                                                                    "-y", "+z", "-z"};
// The side that a direction is nearest to, and how far it is from it.
struct NearestSide {
  std::size_t side = 0;
  double tilt_deg = 0;
};
NearestSide nearest_side(const PerAxis<double>& up);

// The mean of one still stretch in one pose.
struct PoseMean {
  // Up in the case's frame, unit length, as the jig has it: what an ideal sensor reads, in local g.
  PerAxis<double> up{};
  PerAxis<double> mean_lsb{};  // raw counts
  PerAxis<double> sd_lsb{};    // per sample
  int samples = 0;
  std::optional<double> temperature_c;
};

struct SixPoseOptions {
  LocalGravity gravity = gravity_unknown();
  // How far the case may lie off the jig's nominal direction, one sigma, per pose and tilt axis:
  // seating and the case's draft angle. 7 LSB between zero and midpoint in real units are 1.5
  // degrees; their RMS over nine units' axes (domain figures) is 4 LSB or 0.9 degrees.
  static constexpr double tilt_sd_deg = 0.9;
  // Beyond this the unit was put in wrong, not a little askew.
  double most_tilt_deg = 6.0;
  // Samples below this are no mean: half a second at 30 Hz.
  static constexpr int fewest_samples = 15;
  // A sensor has up to 7 mg of noise; three times that is movement.
  double most_sd_mg = 20.0;
  // Magnitude of unused readings, RMS; and the difference between any two readings of one side.
  // Source of both: noise (0.5 mg) and 10 C of drift (5 mg).
  double held_out_mg = 6.0;
  static constexpr double repeatability_mg = 6.0;
  // A sensor's range about nominal (4 mg per LSB, zero at 0): 10 % and 0.5 g (paper, ADXL362), and
  // as much again for what the filter configuration adds (15 % and 0.2 g in real units).
  static constexpr double nominal_g_per_lsb = 0.004;
  double gain_range = 0.25;
  double zero_range_g = 0.7;
};

struct SixPoseSolution {
  Calibration calibration;
  StoredConstants stored;                 // the integers for the unit's memory
  ConstantsUncertainty uncertainty;       // noise, tilt and gravity
  double own_rms_mg = 0;                  // magnitude error on the readings that were used
  std::optional<double> choosing_rms_mg;  // on the unused ones that choose between the solutions
  std::optional<double> held_out_rms_mg;  // and on the unused ones that verify
  std::optional<double> held_out_worst_mg;
  std::optional<double> rounded_rms_mg;  // the same with the nine integers
};

struct AllAxesSolution {
  SixPoseSolution six;                   // |K row| and zero as six constants
  PerAxis<PerAxis<double>> lsb_per_g{};  // K, row per sensor axis, column per case axis
  PerAxis<double> cross_axis{};          // xy, xz, yz: cosines between sensor axes
  PerAxis<double> rotation_deg{};        // of the sensor in its case about X, Y, Z
  PerAxis<double> residual_lsb{};        // RMS per axis
  int degrees_of_freedom = 0;
};

struct PoseResidual {
  std::string side;
  double magnitude_mg = 0;  // by the chosen constants, minus local gravity
  double tilt_deg = 0;      // of the chosen constants' vector from the pose's direction
  bool held_out = false;
  bool chose = false;  // held out, and used to choose between the solutions
};

enum class SixPoseMethod { as_published, per_axis, all_axes };
std::string_view to_string(SixPoseMethod method);  // "letter", "pair", "vector"

struct SixPoseReport {
  SixPoseSolution as_published;
  SixPoseSolution per_axis;
  AllAxesSolution all_axes;
  SixPoseMethod chosen = SixPoseMethod::per_axis;
  double better_by_mg = 0;  // than `as_published`, on the readings that verify
  // Of the held-out readings, in their order, those that chose. Empty: none was left for it, and
  // `per_axis` is taken.
  std::vector<std::size_t> choosing;
  std::vector<PoseResidual> poses;
  PerAxis<double> midpoint_minus_zero_lsb{};  // what the level readings disagree by
  bool verified = false;
  std::vector<std::string> reasons;  // why not verified
  std::vector<std::string> missing_directions;
  LocalGravity gravity;

  const SixPoseSolution& best() const {
    return chosen == SixPoseMethod::as_published ? as_published
           : chosen == SixPoseMethod::per_axis   ? per_axis
                                                 : all_axes.six;
  }
  bool usable() const { return verified; }
  std::string brief() const;
};
nlohmann::ordered_json to_json(const SixPoseSolution& solution);
nlohmann::ordered_json to_json(const SixPoseReport& report);

// `used` must hold every side at least once (more readings and other directions are welcome);
// `held_out` are readings of the same session that the solution does not use. Without any, nothing
// is verified. bad_data for numbers that are not finite, directions that are no unit vectors, or
// readings from which no constants can be made (positive <= negative); a missing side is a report
// with missing_directions and without constants worth using.
Result<SixPoseReport> solve_six_poses(std::span<const PoseMean> used,
                                      std::span<const PoseMean> held_out,
                                      const SixPoseOptions& options = {});

}  // namespace sixpoint::calib
