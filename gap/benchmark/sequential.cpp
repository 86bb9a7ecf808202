#include "gap/benchmark/sequential.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "gap/benchmark/shown.h"

namespace sixpoint::gap {
namespace {

constexpr double kPiece_s = 10;
constexpr std::array<double, 3> kNoise_mg = {3.9, 3.9, 5.5};  // at 100 Hz
constexpr double kEnough_sd = 3;
constexpr double kUnknown_sd = 5.5;
constexpr double kReference_c = 23;

// A mean of one axis: a row of the regression.
struct Row {
  int axis = 0;
  const Segment* segment = nullptr;
  double sigma_mg = 1;
  double off_mg = 0;  // less gravity
  double gravity = 0;
  double warmer_c = 0;
  double time_s = 0;
};

std::vector<Row> rows_of(const Bundle& bundle) {
  std::vector<Row> rows;
  const double lsb_mg = 1000 / bundle.accel_scale_lsb_per_g;
  const auto piece = static_cast<std::size_t>(kPiece_s * bundle.rate_hz);
  for (const Segment& segment : bundle.segments) {
    const std::size_t quiet = segment.quiet_start(bundle.rate_hz);
    for (std::size_t first = quiet; segment.at_rest() && first < segment.samples; first += piece) {
      const std::size_t count = std::min(piece, segment.samples - first);
      const auto n = static_cast<double>(count);
      for (std::size_t axis = 0; axis < 3 && 2 * count > piece; ++axis) {
        double sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
          sum += bundle.samples[segment.first_sample + first + i][axis];
        }
        Row row;
        row.axis = static_cast<int>(axis);
        row.segment = &segment;
        row.gravity = bundle.gravity_in_sensor(segment)[row.axis];
        row.off_mg = lsb_mg * sum / n - 1000 * row.gravity;
        const double noise = kNoise_mg[axis] * std::sqrt(bundle.rate_hz / 100);
        row.sigma_mg =
            std::sqrt((noise * noise + lsb_mg * lsb_mg / 12) / n + kSeating_mg * kSeating_mg);
        row.time_s = segment.host_start_s + (static_cast<double>(first) + n / 2) / bundle.rate_hz;
        row.warmer_c = bundle.temperature_at(row.time_s) - kReference_c;
        rows.push_back(row);
      }
    }
  }
  return rows;
}

// Regressors of one effect: `fill(row, out)` writes `width` numbers.
struct Regressor {
  const char* effect;
  int width;
  void (*fill)(const Row& row, double* out);
};

// A number for each axis.
template <double (*value)(const Row&)>
void per_axis(const Row& row, double* out) {
  std::fill_n(out, 3, 0.0);
  out[row.axis] = value(row);
}

double second(const Row& row) { return row.gravity * row.gravity; }
double third(const Row& row) { return row.gravity * row.gravity * row.gravity; }
double side(const Row& row) { return row.segment->held_sign(row.axis, kUsualStep); }
double warmth(const Row& row) { return row.warmer_c; }
double warm_gravity(const Row& row) { return row.warmer_c * row.gravity; }
double hours(const Row& row) { return row.time_s / 3600; }
template <int tau_s>
double cooling(const Row& row) {
  return std::exp(-row.time_s / tau_s);
}

// The other two components of gravity: turned, or sheared.
void turned(const Row& row, double* out) {
  const Eigen::Vector3d g = row.segment->rotation.col(2);
  const std::array<Eigen::Vector3d, 3> rows = {Eigen::Vector3d(0, g.z(), -g.y()),
                                               Eigen::Vector3d(-g.z(), 0, g.x()),
                                               Eigen::Vector3d(g.y(), -g.x(), 0)};
  std::copy_n(rows[static_cast<std::size_t>(row.axis)].data(), 3, out);
}
void sheared(const Row& row, double* out) {
  const Eigen::Vector3d g = row.segment->rotation.col(2);
  const std::array<Eigen::Vector3d, 3> rows = {Eigen::Vector3d(0, g.z(), g.y()),
                                               Eigen::Vector3d(g.z(), 0, g.x()),
                                               Eigen::Vector3d(g.y(), g.x(), 0)};
  std::copy_n(rows[static_cast<std::size_t>(row.axis)].data(), 3, out);
}
// The level of the jig: gravity leans in the room.
void leaning(const Row& row, double* out) {
  out[0] = row.segment->rotation(row.axis, 0);
  out[1] = row.segment->rotation(row.axis, 1);
}

constexpr std::array kRegressors = {
    Regressor{"tilt", 2, leaning},
    Regressor{"misalignment", 3, turned},
    Regressor{"non_orthogonality", 3, sheared},
    Regressor{"second_order", 3, per_axis<second>},
    Regressor{"third_order", 3, per_axis<third>},
    Regressor{"hysteresis", 3, per_axis<side>},
    Regressor{"offset_tempco", 3, per_axis<warmth>},
    Regressor{"sensitivity_tempco", 3, per_axis<warm_gravity>},
    Regressor{"drift", 3, per_axis<hours>},
    Regressor{"warm_up", 3, per_axis<cooling<180>>},
    Regressor{"warm_up", 3, per_axis<cooling<400>>},
};

struct LeastSquares {
  double chi_square = 0;
  int parameters = 0;
  Eigen::VectorXd left;  // in standard deviations
};

LeastSquares fit(const std::vector<Row>& rows, const std::vector<const Regressor*>& chosen) {
  int width = 6;
  for (const Regressor* regressor : chosen) {
    width += regressor->width;
  }
  Eigen::MatrixXd design = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()), width);
  Eigen::VectorXd wanted(static_cast<Eigen::Index>(rows.size()));
  std::array<double, 3> numbers{};
  for (Eigen::Index i = 0; i < wanted.size(); ++i) {
    const Row& row = rows[static_cast<std::size_t>(i)];
    wanted[i] = row.off_mg / row.sigma_mg;
    design(i, row.axis) = 1 / row.sigma_mg;
    design(i, 3 + row.axis) = row.gravity / row.sigma_mg;
    Eigen::Index column = 6;
    for (const Regressor* regressor : chosen) {
      regressor->fill(row, numbers.data());
      for (int k = 0; k < regressor->width; ++k) {
        design(i, column++) = numbers[static_cast<std::size_t>(k)] / row.sigma_mg;
      }
    }
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(design);
  LeastSquares done;
  done.parameters = static_cast<int>(solver.rank());
  done.left = wanted - design * solver.solve(wanted);
  done.chi_square = done.left.squaredNorm();
  return done;
}

// By how many standard deviations chi-square exceeds its expectation.
double excess_sd(const LeastSquares& fit) {
  const double freedom = static_cast<double>(fit.left.size()) - fit.parameters;
  return freedom < 1 ? 0 : (fit.chi_square - freedom) / std::sqrt(2 * freedom);
}

double logistic(double x) { return 1 / (1 + std::exp(-x)); }

std::set<Place> places_of(const std::vector<Row>& rows, const LeastSquares& fit) {
  std::map<Place, std::array<double, 2>> cells;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    auto& [square, n] = cells[{rows[i].axis, rows[i].segment->name}];
    square += std::pow(fit.left[static_cast<Eigen::Index>(i)], 2);
    n += 1;
  }
  std::set<Place> places;
  for (const auto& [place, cell] : cells) {
    if ((cell[0] - cell[1]) / std::sqrt(2 * cell[1]) > 3) {
      places.insert(place);
    }
  }
  return places;
}

}  // namespace

Answer answer_by_regression(const Bundle& bundle, const std::string& name) {
  Answer answer;
  answer.bundle = name;
  const std::vector<Row> rows = rows_of(bundle);
  std::vector<const Regressor*> chosen;
  LeastSquares now = fit(rows, chosen);
  const double cost = std::log(std::max<double>(1, static_cast<double>(rows.size())));
  while (excess_sd(now) > kEnough_sd) {
    const Regressor* best = nullptr;
    LeastSquares with_best;
    double most = 0;
    for (const Regressor& regressor : kRegressors) {
      if (std::ranges::any_of(chosen, [&](const Regressor* other) {
            return std::string_view(other->effect) == regressor.effect;
          })) {
        continue;
      }
      std::vector<const Regressor*> more = chosen;
      more.push_back(&regressor);
      LeastSquares tried = fit(rows, more);
      const double gain =
          now.chi_square - tried.chi_square - cost * (tried.parameters - now.parameters);
      if (tried.parameters > now.parameters && gain > most) {
        most = gain;
        best = &regressor;
        with_best = std::move(tried);
      }
    }
    if (best == nullptr) {
      break;
    }
    chosen.push_back(best);
    now = std::move(with_best);
    answer.effects.emplace_back(best->effect, logistic(most / 2));
  }
  answer.candidates = answer.effects;
  answer.unknown = excess_sd(now) > kUnknown_sd;
  answer.unknown_probability = logistic(excess_sd(now) - kUnknown_sd);
  if (answer.unknown) {
    answer.where = places_of(rows, now);
  }
  return answer;
}

}  // namespace sixpoint::gap
