#include "calib/application/agreement.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::calib {
namespace {

// 99.7 % of a normal distribution: nine values are compared for every file.
constexpr double kCoverageFactor = 3;

double stated(double value) { return std::isfinite(value) ? value : 0; }

}  // namespace

double standard_uncertainty_mg(const ConstantsUncertainty& uncertainty, std::size_t axis,
                               double at_g) {
  return std::hypot(stated(uncertainty.zero_mg[axis]),
                    kMgPerG * at_g * stated(uncertainty.sensitivity_relative[axis]));
}

double largest_uncertainty_mg(const ConstantsUncertainty& uncertainty) {
  double largest_mg = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    largest_mg = std::max(largest_mg, standard_uncertainty_mg(uncertainty, a, 1));
  }
  return largest_mg;
}

Agreement agreement(const Calibration& first, const ConstantsUncertainty& of_first,
                    const Calibration& second, const ConstantsUncertainty& of_second,
                    double allowance_mg) {
  Agreement worst;
  double worst_share = -1;
  for (std::size_t a = 0; a < kAxes; ++a) {
    for (const double at_g : std::array<double, 3>{0, -1, 1}) {
      const double raw_lsb = first.zero_lsb[a] + at_g / first.sensitivity_g_per_lsb[a];
      const double difference_mg = kMgPerG * std::abs(second.to_g(a, raw_lsb) - at_g);
      const double allowed_mg =
          allowance_mg + kCoverageFactor * std::hypot(standard_uncertainty_mg(of_first, a, at_g),
                                                      standard_uncertainty_mg(of_second, a, at_g));
      const double share = allowed_mg > 0 ? difference_mg / allowed_mg : difference_mg;
      if (share > worst_share) {
        worst_share = share;
        worst = {difference_mg, allowed_mg, a, at_g};
      }
    }
  }
  return worst;
}

std::string Agreement::brief() const {
  return fmt::format(
      "they differ by {:.1f} mg on {} at {:.0f} g; their uncertainties and another temperature "
      "explain {:.1f} mg",
      difference_mg, kAxisNames[axis], at_g, allowed_mg);
}

}  // namespace sixpoint::calib
