#include "calib/poses/six_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calib/direction_cells.h"
#include "calib/least_squares.h"

namespace sixpoint::calib {

namespace {

constexpr double kRadian = M_PI / 180;

double length_of(const PerAxis<double>& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

Status check(std::span<const PoseMean> readings) {
  for (const PoseMean& reading : readings) {
    const bool usable = std::abs(length_of(reading.up) - 1) < 1e-3 &&
                        all_finite(reading.mean_lsb, reading.sd_lsb) &&
                        std::ranges::min(reading.sd_lsb) >= 0 && reading.samples >= 1;
    if (!usable) {
      return fail(ErrorCode::bad_data,
                  "a pose's reading is not a finite number or has no direction", "six poses",
                  "measure the pose again");
    }
  }
  return {};
}

// Variance of one axis' mean, in g: noise, and tilt of the case about its two horizontal axes. On
// an upright axis tilt acts in second order: (1 - cos t) with t^2 of mean 2 sd^2.
double reading_variance_g2(const PoseMean& reading, std::size_t axis, const SixPoseOptions& options,
                           double g_per_lsb) {
  const double noise = reading.sd_lsb[axis] * g_per_lsb;
  const double tilt = options.tilt_sd_deg * kRadian;
  const double level = std::max(0.0, 1 - reading.up[axis] * reading.up[axis]);
  constexpr double kFloor_g = 2e-4;  // a twentieth of a count: quantisation and settling
  return noise * noise / reading.samples + tilt * tilt * level + std::pow(tilt, 4) +
         kFloor_g * kFloor_g;
}

struct Regression {
  Eigen::VectorXd solution;
  Eigen::MatrixXd covariance;  // for the variances as given
  double residual_square = 0;  // unweighted
};

// One axis' mean readings, in LSB, on the columns of `design`, a row per reading.
Regression regress(const Eigen::MatrixXd& design, std::span<const PoseMean> readings,
                   std::size_t axis, const SixPoseOptions& options, double g_per_lsb) {
  Eigen::VectorXd value(design.rows());
  Eigen::VectorXd variance(design.rows());
  for (Eigen::Index i = 0; i < design.rows(); ++i) {
    const PoseMean& reading = readings[static_cast<std::size_t>(i)];
    value[i] = reading.mean_lsb[axis];
    variance[i] = reading_variance_g2(reading, axis, options, g_per_lsb) / (g_per_lsb * g_per_lsb);
  }
  const Eigen::VectorXd weight = variance.cwiseInverse();
  const Eigen::MatrixXd normal = design.transpose() * weight.asDiagonal() * design;
  const Eigen::LDLT<Eigen::MatrixXd> factors(normal);
  Regression out;
  out.solution = factors.solve(design.transpose() * weight.asDiagonal() * value);
  out.covariance = factors.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
  out.residual_square = (value - design * out.solution).squaredNorm();
  return out;
}

std::vector<DirectionCell> cells_from(std::span<const PoseMean> readings) {
  std::vector<DirectionCell> cells;
  for (const PoseMean& reading : readings) {
    DirectionCell cell;
    cell.mean_lsb = reading.mean_lsb;
    cell.blocks = 1;
    cell.neighbourhood = static_cast<int>(nearest_side(reading.up).side);
    cells.push_back(cell);
  }
  return cells;
}

class Jig {
 public:
  Jig(std::span<const PoseMean> used, std::span<const PoseMean> held_out,
      const SixPoseOptions& options)
      : used_(used), held_out_(held_out), options_(options), gravity_g_(options.gravity.g()) {}

  Result<SixPoseReport> run() {
    report_.gravity = options_.gravity;
    find_sides();
    if (!report_.missing_directions.empty()) {
      report_.reasons.push_back(
          fmt::format("no reading with {} up", fmt::join(report_.missing_directions, ", ")));
      return std::move(report_);
    }
    split_held_out();
    SIXPOINT_CHECK(solve_letter());
    SIXPOINT_CHECK(solve_pair());
    SIXPOINT_CHECK(solve_vector());
    for (SixPoseSolution* solution :
         {&report_.as_published, &report_.per_axis, &report_.all_axes.six}) {
      SIXPOINT_CHECK(judge(*solution));
    }
    choose();
    describe_poses();
    verify();
    return std::move(report_);
  }

 private:
  void find_sides() {
    std::array<int, kSides> count{};
    for (const PoseMean& reading : used_) {
      const NearestSide nearest = nearest_side(reading.up);
      if (nearest.tilt_deg < 10) {
        ++count[nearest.side];
      }
    }
    for (std::size_t side = 0; side < kSides; ++side) {
      if (count[side] == 0) {
        report_.missing_directions.emplace_back(kSideNames[side]);
      }
    }
  }

  // Choice and verification by different readings. What is wrong with a solution is wrong on both
  // sides of an axis, so each of the two has a reading of every axis where there are enough.
  void split_held_out() {
    PerAxis<int> readings{};
    for (const PoseMean& reading : held_out_) {
      ++readings[nearest_side(reading.up).side / 2];
    }
    PerAxis<bool> has_chosen{};
    for (std::size_t i = 0; i < held_out_.size(); ++i) {
      const std::size_t axis = nearest_side(held_out_[i].up).side / 2;
      if (readings[axis] > 1 && !has_chosen[axis]) {
        has_chosen[axis] = true;
        report_.choosing.push_back(i);
        choosing_.push_back(held_out_[i]);
      } else {
        verifying_.push_back(held_out_[i]);
      }
    }
  }

  // Mean of one axis over the readings of one side.
  double side_mean(std::size_t side, std::size_t axis) const {
    double sum = 0;
    int count = 0;
    for (const PoseMean& reading : used_) {
      const NearestSide nearest = nearest_side(reading.up);
      if (nearest.side == side && nearest.tilt_deg < 10) {
        sum += reading.mean_lsb[axis];
        ++count;
      }
    }
    return sum / count;
  }

  Status solve_letter() {
    SixPoseSolution& out = report_.as_published;
    const double tilt = options_.tilt_sd_deg * kRadian;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double positive = side_mean(2 * a, a);
      const double negative = side_mean(2 * a + 1, a);
      double zero = 0;
      for (std::size_t side = 0; side < kSides; ++side) {
        zero += side / 2 == a ? 0 : side_mean(side, a) / 4;
      }
      if (!(positive > negative)) {
        return fail(ErrorCode::bad_data,
                    fmt::format("{} axis: the reading at +1 g ({:.1f} LSB) is not above the one at "
                                "-1 g ({:.1f} LSB)",
                                kAxisNames[a], positive, negative),
                    "six poses", "the poses were mixed up, or the unit's sensor is broken");
      }
      // Eq. 1-3, in local gravity.
      out.calibration.sensitivity_g_per_lsb[a] = 2 * gravity_g_ / (positive - negative);
      out.calibration.zero_lsb[a] = zero;
      report_.midpoint_minus_zero_lsb[a] = (positive + negative) / 2 - zero;
      const double noise = 5e-4;
      out.uncertainty.sensitivity_relative[a] = std::hypot(noise, tilt * tilt);
      out.uncertainty.zero_mg[a] = kMgPerG * std::hypot(noise, tilt) / 2;  // mean of four
    }
    return {};
  }

  Status solve_pair() {
    SixPoseSolution& out = report_.per_axis;
    const auto n = static_cast<Eigen::Index>(used_.size());
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g_per_lsb = report_.as_published.calibration.sensitivity_g_per_lsb[a];
      Eigen::MatrixXd design(n, 2);
      for (Eigen::Index i = 0; i < n; ++i) {
        design.row(i) << 1, used_[static_cast<std::size_t>(i)].up[a] * gravity_g_;
      }
      const Regression fit = regress(design, used_, a, options_, g_per_lsb);
      const double slope = fit.solution[1];
      if (!(slope > 0)) {
        return fail(ErrorCode::bad_data, "no positive sensitivity fits the readings", "six poses",
                    "the poses were mixed up, or the unit's sensor is broken");
      }
      out.calibration.sensitivity_g_per_lsb[a] = 1 / slope;
      out.calibration.zero_lsb[a] = fit.solution[0];
      out.uncertainty.sensitivity_relative[a] = std::sqrt(fit.covariance(1, 1)) / slope;
      out.uncertainty.zero_mg[a] = kMgPerG * std::sqrt(fit.covariance(0, 0)) / slope;
    }
    return {};
  }

  Status solve_vector() {
    AllAxesSolution& out = report_.all_axes;
    const auto n = static_cast<Eigen::Index>(used_.size());
    Eigen::MatrixXd design(n, 4);
    for (Eigen::Index i = 0; i < n; ++i) {
      const PerAxis<double>& up = used_[static_cast<std::size_t>(i)].up;
      design.row(i) << 1, up[0] * gravity_g_, up[1] * gravity_g_, up[2] * gravity_g_;
    }
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g_per_lsb = report_.per_axis.calibration.sensitivity_g_per_lsb[a];
      const Regression fit = regress(design, used_, a, options_, g_per_lsb);
      PerAxis<double> row{};
      for (std::size_t b = 0; b < kAxes; ++b) {
        row[b] = fit.solution[1 + static_cast<Eigen::Index>(b)];
      }
      out.lsb_per_g[a] = row;
      const double gain = length_of(row);
      out.six.calibration.sensitivity_g_per_lsb[a] = 1 / gain;
      out.six.calibration.zero_lsb[a] = fit.solution[0];
      const auto own = 1 + static_cast<Eigen::Index>(a);
      out.six.uncertainty.sensitivity_relative[a] = std::sqrt(fit.covariance(own, own)) / gain;
      out.six.uncertainty.zero_mg[a] = kMgPerG * std::sqrt(fit.covariance(0, 0)) / gain;
      out.residual_lsb[a] = std::sqrt(fit.residual_square / static_cast<double>(n));
    }
    out.degrees_of_freedom = 3 * (static_cast<int>(used_.size()) - 4);
    // Rows of unit length: the sensor's axes in the case. Cosines between them are the cross-axis
    // terms; what is left of their directions is a rotation.
    Eigen::Matrix3d axes;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        axes(a, b) = out.lsb_per_g[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      }
      axes.row(a).normalize();
    }
    out.cross_axis = {axes.row(0).dot(axes.row(1)), axes.row(0).dot(axes.row(2)),
                      axes.row(1).dot(axes.row(2))};
    out.rotation_deg = {(axes(1, 2) - axes(2, 1)) / 2 / kRadian,
                        (axes(2, 0) - axes(0, 2)) / 2 / kRadian,
                        (axes(0, 1) - axes(1, 0)) / 2 / kRadian};
    return validate(out.six.calibration);
  }

  double rms_mg(std::span<const PoseMean> readings, const Calibration& calibration,
                double* worst = nullptr) const {
    double square = 0;
    for (const PoseMean& reading : readings) {
      const double off =
          kMgPerG * (magnitude_g(calibration, reading.mean_lsb, {0, 0, 0}) - gravity_g_);
      square += off * off;
      if (worst != nullptr) {
        *worst = std::max(*worst, std::abs(off));
      }
    }
    return std::sqrt(square / static_cast<double>(std::max<std::size_t>(1, readings.size())));
  }

  Status judge(SixPoseSolution& solution) const {
    SIXPOINT_CHECK(validate(solution.calibration));
    solution.own_rms_mg = rms_mg(used_, solution.calibration);
    const auto cells = cells_from(used_);
    SIXPOINT_ASSIGN(solution.stored, round_constants(solution.calibration, cells, {}, gravity_g_));
    if (&solution == &report_.as_published) {
      // As published: every reading rounded by itself.
      SIXPOINT_ASSIGN(solution.stored, nearest_stored(solution.calibration));
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double midpoint =
            solution.calibration.zero_lsb[a] + report_.midpoint_minus_zero_lsb[a];
        const double half = 1 / solution.calibration.sensitivity_g_per_lsb[a];
        solution.stored.positive_lsb[a] = static_cast<int>(std::lround(midpoint + half));
        solution.stored.negative_lsb[a] = static_cast<int>(std::lround(midpoint - half));
      }
    }
    SIXPOINT_ASSIGN(const Calibration applied, calibration_from(solution.stored));
    solution.rounded_rms_mg = rms_mg(verifying_.empty() ? used_ : verifying_, applied);
    if (!choosing_.empty()) {
      solution.choosing_rms_mg = rms_mg(choosing_, solution.calibration);
    }
    if (!verifying_.empty()) {
      double worst = 0;
      solution.held_out_rms_mg = rms_mg(verifying_, solution.calibration, &worst);
      solution.held_out_worst_mg = worst;
    }
    for (double& relative : solution.uncertainty.sensitivity_relative) {
      relative = std::hypot(relative, options_.gravity.sd_g() / gravity_g_);
    }
    return {};
  }

  void choose() {
    const auto error = [](const SixPoseSolution& solution) {
      return solution.choosing_rms_mg.value_or(0);
    };
    // The pair is left only for a gain that chance does not give: the RMS over three poses,
    // each the mean of six seconds, scatters by a tenth of a milligravity.
    constexpr double kMatters_mg = 0.3;
    report_.chosen = SixPoseMethod::per_axis;
    if (error(report_.as_published) < error(report_.best()) - kMatters_mg) {
      report_.chosen = SixPoseMethod::as_published;
    }
    if (error(report_.all_axes.six) < error(report_.best()) - kMatters_mg) {
      report_.chosen = SixPoseMethod::all_axes;
    }
    report_.better_by_mg = report_.as_published.held_out_rms_mg.value_or(0) -
                           report_.best().held_out_rms_mg.value_or(0);
  }

  void describe_poses() {
    const Calibration& calibration = report_.best().calibration;
    const auto add = [&](const PoseMean& reading, bool held_out, bool chose) {
      const PerAxis<double> g = calibration.to_g(reading.mean_lsb);
      const double length = length_of(g);
      const double along =
          (g[0] * reading.up[0] + g[1] * reading.up[1] + g[2] * reading.up[2]) / length;
      report_.poses.push_back({std::string(kSideNames[nearest_side(reading.up).side]),
                               kMgPerG * (length - gravity_g_),
                               std::acos(std::clamp(along, -1.0, 1.0)) / kRadian, held_out, chose});
    };
    for (const PoseMean& reading : used_) {
      add(reading, false, false);
    }
    for (std::size_t i = 0; i < held_out_.size(); ++i) {
      add(held_out_[i], true, std::ranges::find(report_.choosing, i) != report_.choosing.end());
    }
  }

  void verify() {
    check_readings();
    check_poses();
    check_sensor();
    const auto held_out_mg = report_.best().held_out_rms_mg;
    if (!held_out_mg) {
      report_.reasons.emplace_back("no readings were left out to verify with");
    } else if (!(*held_out_mg <= options_.held_out_mg)) {
      report_.reasons.push_back(
          fmt::format("unused readings are {:.1f} mg from local gravity (limit {:.1f} mg)",
                      *held_out_mg, options_.held_out_mg));
    }
    report_.verified = report_.reasons.empty();
  }

  void check_readings() {
    const PerAxis<double>& sensitivity = report_.best().calibration.sensitivity_g_per_lsb;
    for (const auto readings : {used_, held_out_}) {
      for (const PoseMean& reading : readings) {
        const auto side = kSideNames[nearest_side(reading.up).side];
        if (reading.samples < options_.fewest_samples) {
          report_.reasons.push_back(fmt::format("{}: only {} samples", side, reading.samples));
        }
        for (std::size_t a = 0; a < kAxes; ++a) {
          const double sd_mg = kMgPerG * reading.sd_lsb[a] * sensitivity[a];
          if (sd_mg > options_.most_sd_mg) {
            report_.reasons.push_back(
                fmt::format("{}: moved, {} scatters by {:.0f} mg (limit {:.0f} mg)", side,
                            kAxisNames[a], sd_mg, options_.most_sd_mg));
          }
        }
      }
    }
  }

  // Of every reading its tilt, of every side its repeatability.
  void check_poses() {
    for (const PoseResidual& pose : report_.poses) {
      if (pose.tilt_deg > options_.most_tilt_deg) {
        report_.reasons.push_back(
            fmt::format("{}: {:.1f} degrees off the jig's direction (limit {:.0f})", pose.side,
                        pose.tilt_deg, options_.most_tilt_deg));
      }
    }
    for (const std::string_view side : kSideNames) {
      double low = HUGE_VAL;
      double high = -HUGE_VAL;
      for (const PoseResidual& pose : report_.poses) {
        if (pose.side == side) {
          low = std::min(low, pose.magnitude_mg);
          high = std::max(high, pose.magnitude_mg);
        }
      }
      if (high - low > options_.repeatability_mg) {
        report_.reasons.push_back(fmt::format("{}: readings differ by {:.1f} mg (limit {:.1f} mg)",
                                              side, high - low, options_.repeatability_mg));
      }
    }
  }

  // The constants are those of a working sensor.
  void check_sensor() {
    const Calibration& calibration = report_.best().calibration;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double gain = calibration.sensitivity_g_per_lsb[a] / options_.nominal_g_per_lsb;
      const double zero_g = calibration.zero_lsb[a] * calibration.sensitivity_g_per_lsb[a];
      if (!(std::abs(gain - 1) <= options_.gain_range)) {
        report_.reasons.push_back(
            fmt::format("{}: a sensitivity {:.0f} % from nominal (limit {:.0f} %)", kAxisNames[a],
                        100 * std::abs(gain - 1), 100 * options_.gain_range));
      }
      if (!(std::abs(zero_g) <= options_.zero_range_g)) {
        report_.reasons.push_back(fmt::format("{}: a zero of {:.2f} g (limit {:.2f} g)",
                                              kAxisNames[a], zero_g, options_.zero_range_g));
      }
    }
  }

  std::span<const PoseMean> used_;
  std::span<const PoseMean> held_out_;
  std::vector<PoseMean> choosing_;
  std::vector<PoseMean> verifying_;
  const SixPoseOptions& options_;
  double gravity_g_;
  SixPoseReport report_;
};

}  // namespace

NearestSide nearest_side(const PerAxis<double>& up) {
  NearestSide out;
  double best = -2;
  const double length = length_of(up);
  for (std::size_t side = 0; side < kSides; ++side) {
    const double cosine = length > 0 ? up[side / 2] * (side % 2 == 0 ? 1 : -1) / length : -1;
    if (cosine > best) {
      best = cosine;
      out.side = side;
    }
  }
  out.tilt_deg = std::acos(std::clamp(best, -1.0, 1.0)) / kRadian;
  return out;
}

std::string_view to_string(SixPoseMethod method) {
  constexpr std::array<std::string_view, 3> kNames = {"letter", "pair", "vector"};
  return kNames[static_cast<std::size_t>(method)];
}

Result<SixPoseReport> solve_six_poses(std::span<const PoseMean> used,
                                      std::span<const PoseMean> held_out,
                                      const SixPoseOptions& options) {
  SIXPOINT_CHECK(check(used));
  SIXPOINT_CHECK(check(held_out));
  if (!(options.gravity.m_per_s2 > 9.7 && options.gravity.m_per_s2 < 9.9)) {
    return fail(ErrorCode::usage, "the station's gravity makes no sense", "six poses",
                "enter the station's gravity");
  }
  return Jig(used, held_out, options).run();
}

std::string SixPoseReport::brief() const {
  if (!missing_directions.empty()) {
    return fmt::format("{}", fmt::join(reasons, "; "));
  }
  const SixPoseSolution& solution = best();
  std::string line =
      fmt::format("{}, by {}", verified ? "verified" : "not verified", to_string(chosen));
  if (solution.held_out_rms_mg) {
    line += fmt::format(", unused readings within {:.1f} mg ({:.1f} mg better than Eq. 1-3)",
                        *solution.held_out_rms_mg, better_by_mg);
  }
  if (!reasons.empty()) {
    line += fmt::format(": {}", fmt::join(reasons, "; "));
  }
  return line;
}

}  // namespace sixpoint::calib
