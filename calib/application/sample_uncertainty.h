// How far a repaired sample may be from what the sensor felt: one standard uncertainty per axis.
//
//   RepairedBy by;
//   by.constants = record.uncertainty;
//   by.fresh = record.calibration;
//   by.before = file_constants;
//   by.accel_scale_lsb_per_g = 256;
//   const SampleUncertainty sample = sample_uncertainty(by);
//   const double x_mg = sample.mg[0];
//
// The law of propagation of uncertainty (GUM, JCGM 100:2008, 5.1.2) for a sample of
// q_a = s_a (m_a - z_a) + sum_b C_ab u_b, each term of its own origin:
//
//     u(q_a)^2 = u(z_a)^2 + [u(s_a)^2 + sum_b u(C_ab)^2] / 3     the constants
//              + sum_b L_ab^2 / 3                                terms that are known, not applied
//              + s_a^2 / 12                                      the sensor's own whole counts
//              + s_a^2 v_a                                       which whole count it was
//              + 1 / (12 scale^2)                                the one rounding of the repair
//
// s in relative terms, z in g. The thirds: the sample has the length of 1 g, in any direction, and
// the mean of n_x^2 over all directions is 1/3. Over all directions the covariances between the
// constants drop out, because the mean of n_x, and of n_x n_y, is zero. An even distribution over
// an interval has the variance of its square / 12 (GUM, 4.3.7). v_a is in counts:
//
// | the file was rescaled by              | v_a                                                   |
// |---------------------------------------|-------------------------------------------------------|
// | whole counts, each count of the file  | 0                                                     |
// | has one                               |                                                       |
// | whole counts, slope k < 1 of the      | the variance of n equal counts, (n^2 - 1) / 12, over  |
// | firmware: some have two or more       | the n = 1/k rounded down and up that occur            |
// | the affine map                        | 1 / (12 k^2): the firmware's rounding stays in it     |
//
// k = file counts per raw count by the constants before (old sensitivity times scale). Records of
// 12 and 16 bits have the same scale, so the same uncertainty. Not in it: noise and bandwidth of
// the sensor, samples that were clipped, and cross-axis terms that no one has determined. Pure
// function.
#pragma once

#include "base/measure.h"
#include "calib/constants.h"

namespace sixpoint::calib {

struct RepairedBy {
  ConstantsUncertainty constants;  // of the map that was applied
  Calibration fresh;
  Calibration before;
  double accel_scale_lsb_per_g = 256;
  bool affine = false;                   // Rescale::Options::affine
  PerAxis<double> cross_axis_sd{};       // xy, xz, yz; where the terms are applied
  PerAxis<double> cross_axis_ignored{};  // terms that are known and were not applied
};

struct SampleUncertainty {
  PerAxis<double> mg{};
  // Its parts.
  PerAxis<double> constants_mg{};
  PerAxis<double> cross_axis_ignored_mg{};
  PerAxis<double> sensor_counts_mg{};
  PerAxis<double> recovery_mg{};
  double rounding_mg = 0;
};

SampleUncertainty sample_uncertainty(const RepairedBy& by);

}  // namespace sixpoint::calib
