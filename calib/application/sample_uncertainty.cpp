#include "calib/application/sample_uncertainty.h"

#include <array>
#include <cmath>

namespace sixpoint::calib {

namespace {

// Terms xy, xz, yz: which two of them belong to an axis.
constexpr PerAxis<std::array<std::size_t, 2>> kTermsOf = {{{0, 1}, {0, 2}, {1, 2}}};

// In raw counts, for `k` counts of the file per raw count.
double recovery_variance(double k, bool affine) {
  if (affine) {
    return 1 / (12 * k * k);
  }
  if (k >= 1) {
    return 0;
  }
  const double fewer = std::floor(1 / k);
  const double more = fewer + 1;
  const double share_of_more = 1 / k - fewer;  // of the file's counts
  const auto squares = [](double n) { return n * (n * n - 1) / 12; };
  return k * ((1 - share_of_more) * squares(fewer) + share_of_more * squares(more));
}

}  // namespace

SampleUncertainty sample_uncertainty(const RepairedBy& by) {
  SampleUncertainty out;
  out.rounding_mg = kMgPerG / by.accel_scale_lsb_per_g / std::sqrt(12.0);
  for (std::size_t a = 0; a < kAxes; ++a) {
    double terms = 0;
    double ignored = 0;
    for (const std::size_t k : kTermsOf[a]) {
      terms += by.cross_axis_sd[k] * by.cross_axis_sd[k];
      ignored += by.cross_axis_ignored[k] * by.cross_axis_ignored[k];
    }
    const double relative = by.constants.sensitivity_relative[a];
    const double count_mg = kMgPerG * by.fresh.sensitivity_g_per_lsb[a];
    const double k = by.before.sensitivity_g_per_lsb[a] * by.accel_scale_lsb_per_g;
    out.constants_mg[a] =
        std::hypot(by.constants.zero_mg[a], kMgPerG * std::sqrt((relative * relative + terms) / 3));
    out.cross_axis_ignored_mg[a] = kMgPerG * std::sqrt(ignored / 3);
    out.sensor_counts_mg[a] = count_mg / std::sqrt(12.0);
    out.recovery_mg[a] = count_mg * std::sqrt(recovery_variance(k, by.affine));
    double square = out.rounding_mg * out.rounding_mg;
    for (const double part : {out.constants_mg[a], out.cross_axis_ignored_mg[a],
                              out.sensor_counts_mg[a], out.recovery_mg[a]}) {
      square += part * part;
    }
    out.mg[a] = std::sqrt(square);
  }
  return out;
}

}  // namespace sixpoint::calib
