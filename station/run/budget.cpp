#include "station/run/budget.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "station/run/jig_report.h"

namespace sixpoint::station {

namespace {

constexpr double kRadian = std::numbers::pi / 180;
constexpr double kNominal_g_per_lsb = 0.004;  // ADXL362 datasheet, range of 8 g
// By convention: quantisation and slow noise leave this much of a mean of 6 s.
constexpr double kMeanFloor_mg = 0.2;
constexpr double kThermometer_c = 1;  // the sensor's own thermometer, adjusted at one temperature
constexpr double kThermometerStep_c = 0.065;     // ADXL362 datasheet
constexpr double kSeating_rad = 0.02 * kRadian;  // a careful placement on a clean jig, twice
// Student's factors for 95.45 %, over the coverage factor 2 that they replace: level_scatter_mg()
// has three degrees of freedom, the residuals of the vector solution have six.
constexpr double kStudent3 = 3.31 / 2;
constexpr double kStudent6 = 2.52 / 2;

double square(double value) { return value * value; }

// What the readings of a run have in common.
struct Readings {
  PerAxis<double> noise_mg{};  // root mean square over the faces
  double mean_noise_mg = 0;    // of the mean of one face, the worst axis
  double samples = 0;          // of all faces
  double mean_c = 0;           // over the faces
  double coldest_c = HUGE_VAL;
  double warmest_c = -HUGE_VAL;
  double tilt_deg = 0;  // the worst face
};

Readings readings_of(const JigReport& report, const PerAxis<double>& g_per_lsb) {
  Readings out;
  const auto count = static_cast<double>(report.faces.size());
  const auto add_temperature = [&out](double temperature_c) {
    out.coldest_c = std::min(out.coldest_c, temperature_c);
    out.warmest_c = std::max(out.warmest_c, temperature_c);
  };
  PerAxis<double> variance_mg2{};
  for (const PoseReading& face : report.faces) {
    out.samples += face.samples;
    out.mean_c += face.temperature_c / count;
    out.tilt_deg = std::max(out.tilt_deg, face.tilt_deg);
    add_temperature(face.temperature_c);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      variance_mg2[axis] += square(kMgPerG * face.sd_lsb[axis] * g_per_lsb[axis]) / count;
    }
  }
  for (const JudgedPose& pose : report.verification.poses) {
    add_temperature(pose.reading.temperature_c);
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    out.noise_mg[axis] = std::sqrt(variance_mg2[axis]);
  }
  const double worst_mg = *std::max_element(out.noise_mg.begin(), out.noise_mg.end());
  out.mean_noise_mg =
      std::hypot(kMeanFloor_mg, worst_mg / std::sqrt(std::max(1.0, out.samples / count)));
  return out;
}

// Scatter of one level reading, standard deviation. An axis lies level in two pairs of opposite
// poses; a sensor that is askew in its case cancels within a pair, so the means of the two pairs
// differ by seating and draft angle only. Their difference has the variance of one reading:
// 2 / 4 + 2 / 4. One degree of freedom per axis.
double level_scatter_mg(const JigReport& report, const PerAxis<double>& g_per_lsb) {
  double square_mg2 = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double difference_lsb = 0;
    for (const PoseReading& face : report.faces) {
      const std::size_t upright = device::axis_of(face.pose);
      if (upright != axis) {
        difference_lsb += (upright == (axis + 1) % kAxes ? 0.5 : -0.5) * face.mean_lsb[axis];
      }
    }
    square_mg2 += square(kMgPerG * difference_lsb * g_per_lsb[axis]) / kAxes;
  }
  return std::sqrt(square_mg2);
}

// Scatter of the seating, in radians, from what the vector solution leaves of the level readings.
double seating_scatter_rad(const JigReport& report, const PerAxis<double>& g_per_lsb) {
  const calib::AllAxesSolution& vector = report.six->all_axes;
  double square_g2 = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    square_g2 += square(vector.residual_lsb[axis] * g_per_lsb[axis]) *
                 static_cast<double>(report.faces.size()) / std::max(1, vector.degrees_of_freedom);
  }
  return std::sqrt(square_g2);
}

// Of a run without any sample there is no such number: the verdict says so.
double lost_samples_percent(const device::StreamStatistics& stream) {
  const auto lost = static_cast<double>(stream.lost_samples);
  const double sent = static_cast<double>(stream.samples) + lost;
  return sent > 0 ? 100 * lost / sent : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::vector<Measured> measured_quantities(const JigReport& report) {
  if (!report.six || !report.six->missing_directions.empty() || report.faces.empty()) {
    return {};
  }
  const calib::SixPoseSolution& best = report.six->best();
  const PerAxis<double>& g_per_lsb = best.calibration.sensitivity_g_per_lsb;
  const calib::ConstantsUncertainty& combined = report.combined;
  const Readings readings = readings_of(report, g_per_lsb);
  const auto count = static_cast<double>(report.faces.size());
  const double mean_mg = readings.mean_noise_mg;

  std::vector<Measured> measured;
  const auto add = [&measured](std::string_view name, double value, double uncertainty) {
    measured.push_back({std::string(name), "", value, uncertainty});
  };
  const auto add_axes = [&measured](std::string_view name, const auto& value,
                                    const auto& uncertainty) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      measured.push_back(
          {std::string(name), std::string(kAxisNames[axis]), value(axis), uncertainty(axis)});
    }
  };
  const auto none = [](std::size_t /*axis*/) { return 0.0; };

  const auto ratio = [&](std::size_t axis) { return g_per_lsb[axis] / kNominal_g_per_lsb; };
  add_axes(
      "sensitivity_deviation_percent", [&](std::size_t axis) { return 100 * (ratio(axis) - 1); },
      [&](std::size_t axis) { return 100 * ratio(axis) * combined.sensitivity_relative[axis]; });
  const auto zero_mg = [&](std::size_t axis) {
    return kMgPerG * best.calibration.zero_lsb[axis] * g_per_lsb[axis];
  };
  // A value in mg is counts times sensitivity. What the constants leave on unused poses is in both,
  // and may be one error.
  const auto zero_u_mg = [&](std::size_t axis) {
    const double value_mg = std::abs(zero_mg(axis));
    const double both_mg2 = 2 * value_mg / kMgPerG * square(report.verification.rms_mg);
    return std::sqrt(square(combined.zero_mg[axis]) +
                     square(value_mg * combined.sensitivity_relative[axis]) + both_mg2);
  };
  add_axes("zero_offset_mg", zero_mg, zero_u_mg);
  // A mean of two readings, in which tilt counts in second order, minus a mean of four.
  const double level_mg = level_scatter_mg(report, g_per_lsb);
  const double midpoint_u_mg =
      std::hypot(mean_mg / std::sqrt(2.0),
                 std::hypot(kStudent3 * level_mg, kMgPerG * kSeating_rad, mean_mg) / 2);
  const auto midpoint_mg = [&](std::size_t axis) {
    return kMgPerG * report.six->midpoint_minus_zero_lsb[axis] * g_per_lsb[axis];
  };
  add_axes("midpoint_minus_zero_mg", midpoint_mg, [&](std::size_t axis) {
    return std::hypot(midpoint_u_mg, midpoint_mg(axis) * combined.sensitivity_relative[axis]);
  });
  const auto noise_mg = [&](std::size_t axis) { return readings.noise_mg[axis]; };
  add_axes("noise_mg", noise_mg, [&](std::size_t axis) {
    return noise_mg(axis) / std::sqrt(2 * std::max(1.0, readings.samples - count));
  });
  constexpr std::array<std::string_view, 3> kPairs = {"xy", "xz", "yz"};
  const double cross_u_percent =
      100 * std::hypot(kSeating_rad, kStudent6 * seating_scatter_rad(report, g_per_lsb));
  for (std::size_t pair = 0; pair < kPairs.size(); ++pair) {
    measured.push_back({"cross_axis_percent", std::string(kPairs[pair]),
                        100 * report.six->all_axes.cross_axis[pair], cross_u_percent});
  }
  add("temperature_c", readings.mean_c, kThermometer_c);
  add("temperature_change_c", readings.warmest_c - readings.coldest_c, kThermometerStep_c);
  add("tilt_deg", readings.tilt_deg, mean_mg / kMgPerG / kRadian);
  add("fit_residual_mg", best.own_rms_mg, mean_mg / std::sqrt(count));
  add("verification_residual_mg", report.verification.worst_mg, mean_mg);
  add("rounded_residual_mg", report.rounded_residual_mg, mean_mg);
  if (report.written) {
    add("recheck_residual_mg", report.recheck.worst_mg, mean_mg);
  }
  const double coverage = report.limits.decision.coverage_factor;
  add_axes(
      "sensitivity_uncertainty_percent",
      [&](std::size_t axis) { return 100 * coverage * combined.sensitivity_relative[axis]; }, none);
  add_axes(
      "zero_uncertainty_mg", [&](std::size_t axis) { return coverage * zero_u_mg(axis); }, none);
  add("lost_samples_percent", lost_samples_percent(report.stream), 0);
  return measured;
}

}  // namespace sixpoint::station
