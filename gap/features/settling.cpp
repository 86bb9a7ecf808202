#include "gap/features/settling.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "gap/recording/at_rest.h"

namespace sixpoint::gap {

double StepResponse::Mode::at(double t_s) const {
  return amplitude == 0 ? 0
                        : amplitude * std::exp(-t_s / decay_s) *
                              std::cos(2 * M_PI * frequency_hz * t_s + phase_rad);
}

namespace {

constexpr double kStep_g = 0.2;        // smaller steps of a pose are not used
constexpr double kAxisStep_mg = 100;   // nor axes that the step hardly moves
constexpr double kTwoModes_nats = 20;  // a second mode has four unknowns of its own on a grid

// The mean deviation after all steps, as a share of the step, and the weight of each sample.
class Deviation {
 public:
  explicit Deviation(double rate_hz)
      : rate_hz_(rate_hz),
        length_(static_cast<std::size_t>(3 * rate_hz)),
        share_(length_, 0),
        weight_(length_, 0) {}

  bool takes(const Segment& segment) const {
    return segment.at_rest() && segment.may_ring() && segment.samples >= 2 * length_ &&
           segment.approach_g.cwiseAbs().maxCoeff() >= kStep_g;
  }

  // One axis of one dwell, its rest and the lines taken from what follows; `variance` of one
  // sample.
  void add(const CleanSamples& clean, const Segment& segment, std::size_t axis, double variance,
           const std::vector<double>& lines_hz) {
    constexpr std::size_t kLeast = 100;  // samples at rest
    const double step_mg = 1000 * segment.approach_g[static_cast<Eigen::Index>(axis)];
    if (std::abs(step_mg) < kAxisStep_mg || !(variance > 0)) {
      return;
    }
    std::vector<Reading> ringing, resting;
    const Places places = places_by_clock(clean, segment, std::min(segment.samples, 4 * length_));
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i]) {
        (*places[i] < length_ ? ringing : resting)
            .push_back({*places[i], clean.value_mg(segment.first_sample + i, axis)});
      }
    }
    if (resting.size() < kLeast) {
      return;
    }
    const std::vector<double> rest = rest_of(resting, lines_hz);
    ++steps_;
    for (const auto& [at, x_mg] : ringing) {
      share_[at] += step_mg * (x_mg - rest[at]) / variance;
      weight_[at] += step_mg * step_mg / variance;
    }
  }

  // Divides by the weights; false where there were too few steps.
  bool finish() {
    constexpr double kLightest = 0.2;  // of the heaviest sample: lighter ones are mostly masked
    most_ = *std::max_element(weight_.begin(), weight_.end());
    if (steps_ < 2 || !(most_ > 0)) {
      return false;
    }
    for (std::size_t i = 0; i < length_; ++i) {
      const bool heavy = weight_[i] > kLightest * most_;
      share_[i] = heavy ? share_[i] / weight_[i] : 0;
      weight_[i] = heavy ? weight_[i] : 0;
    }
    return true;
  }

  const std::vector<double>& share() const { return share_; }
  double sd() const { return 1 / std::sqrt(most_); }

  std::vector<double> without(const StepResponse::Mode& mode) const {
    std::vector<double> data = share_;
    for (std::size_t i = 0; i < length_; ++i) {
      data[i] -= mode.at(at_s(i));
    }
    return data;
  }

  // Every frequency and decay on a grid, then finer; amplitude and phase in closed form.
  StepResponse::Mode fit(const std::vector<double>& data, double& gain_nats) const {
    StepResponse::Mode best;
    gain_nats = 0;
    const auto try_one = [&](double frequency_hz, double decay_s) {
      const auto [mode, nats] = fit_at(data, frequency_hz, decay_s);
      if (nats > gain_nats) {
        gain_nats = nats;
        best = mode;
      }
    };
    for (const double decay_s : {0.1, 0.15, 0.2, 0.27, 0.36, 0.48, 0.65, 0.9}) {
      const auto frequencies = static_cast<int>(4 * (std::min(30.0, 0.4 * rate_hz_) - 2));
      for (int k = 0; k <= frequencies; ++k) {
        try_one(2 + 0.25 * k, decay_s);
      }
    }
    for (int round = 1; round <= 4; ++round) {
      const StepResponse::Mode centre = best;
      for (int i = -3; i <= 3; ++i) {
        for (int k = -3; k <= 3; ++k) {
          try_one(std::max(0.5, centre.frequency_hz + i * 0.08 / round),
                  std::max(0.03, centre.decay_s * (1 + k * 0.1 / round)));
        }
      }
    }
    return best;
  }

  // Log likelihood of the best exponential without ringing.
  double plain_nats() const {
    double best = 0;
    for (const double decay_s : {0.05, 0.1, 0.2, 0.4, 0.8}) {
      double a = 0;
      double b = 0;
      for (std::size_t i = 0; i < length_; ++i) {
        const double e = std::exp(-at_s(i) / decay_s);
        a += weight_[i] * e * e;
        b += weight_[i] * e * share_[i];
      }
      best = std::max(best, 0.5 * b * b / a);
    }
    return best;
  }

  // Chi-square of the first second about `model`, in sd over its mean.
  double left_sd(const std::function<double(double)>& model) const {
    double chi = 0;
    double n = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(rate_hz_); ++i) {
      if (weight_[i] > 0) {
        chi += weight_[i] * std::pow(share_[i] - model(at_s(i)), 2);
        n += 1;
      }
    }
    return n > 0 ? (chi - n) / std::sqrt(2 * n) : 0;
  }

 private:
  double at_s(std::size_t i) const { return static_cast<double>(i) / rate_hz_; }

  struct Reading {
    std::size_t place;
    double x_mg;
  };

  // Level and lines at each of the first places, by least squares from what rests behind them.
  std::vector<double> rest_of(const std::vector<Reading>& resting,
                              const std::vector<double>& lines_hz) const {
    double level_mg = 0;
    for (const Reading& reading : resting) {
      level_mg += reading.x_mg;
    }
    level_mg /= static_cast<double>(resting.size());
    if (lines_hz.empty()) {
      return std::vector<double>(length_, level_mg);
    }
    constexpr double kRegular = 1e-6;  // lines of nearly one frequency
    const auto columns = static_cast<Eigen::Index>(1 + 2 * lines_hz.size());
    const auto row_of = [&](std::size_t i) {
      Eigen::VectorXd row = Eigen::VectorXd::Ones(columns);
      for (std::size_t k = 0; k < lines_hz.size(); ++k) {
        const double p = 2 * M_PI * lines_hz[k] * at_s(i);
        row[static_cast<Eigen::Index>(1 + 2 * k)] = std::cos(p);
        row[static_cast<Eigen::Index>(2 + 2 * k)] = std::sin(p);
      }
      return row;
    };
    Eigen::MatrixXd a = kRegular * static_cast<double>(resting.size()) *
                        Eigen::MatrixXd::Identity(columns, columns);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(columns);
    for (const Reading& reading : resting) {
      const Eigen::VectorXd row = row_of(reading.place);
      a.selfadjointView<Eigen::Lower>().rankUpdate(row);
      b += row * (reading.x_mg - level_mg);
    }
    const Eigen::VectorXd x = a.selfadjointView<Eigen::Lower>().ldlt().solve(b);
    std::vector<double> rest(length_);
    for (std::size_t i = 0; i < length_; ++i) {
      rest[i] = level_mg + row_of(i).dot(x);
    }
    return rest;
  }

  std::pair<StepResponse::Mode, double> fit_at(const std::vector<double>& data, double frequency_hz,
                                               double decay_s) const {
    Eigen::Matrix2d a = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < length_; ++i) {
      const double e = std::exp(-at_s(i) / decay_s);
      if (e < 1e-3) {
        break;
      }
      const double p = 2 * M_PI * frequency_hz * at_s(i);
      const Eigen::Vector2d row(e * std::cos(p), -e * std::sin(p));
      a += weight_[i] * row * row.transpose();
      b += weight_[i] * row * data[i];
    }
    a.diagonal().array() += 1e-9 * most_;
    const Eigen::Matrix2d inverse = a.inverse();
    const Eigen::Vector2d x = inverse * b;
    return {{x.norm(), std::sqrt(inverse.diagonal().maxCoeff()), frequency_hz, decay_s,
             std::atan2(x[1], x[0])},
            0.5 * b.dot(x)};
  }

  double rate_hz_;
  std::size_t length_;
  std::size_t steps_ = 0;
  double most_ = 0;  // largest weight
  std::vector<double> share_, weight_;
};

}  // namespace

StepResponse step_response(const Bundle& bundle, const CleanSamples& clean,
                           const NoiseSpectrum& noise, const std::vector<double>& lines_hz,
                           const std::function<bool(const Segment&)>& use) {
  StepResponse response;
  Deviation deviation(bundle.rate_hz);
  for (const Segment& segment : bundle.segments) {
    if (deviation.takes(segment) && (!use || use(segment))) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        deviation.add(clean, segment, axis, noise.white_mg[axis] * noise.white_mg[axis], lines_hz);
      }
    }
  }
  response.usable = deviation.finish();
  response.share = deviation.share();
  if (!response.usable) {
    return response;
  }
  response.sd = deviation.sd();
  response.mode = deviation.fit(deviation.share(), response.gain_nats);
  double nats = 0;
  StepResponse::Mode second = deviation.fit(deviation.without(response.mode), nats);
  if (nats > kTwoModes_nats) {
    // Each once more with the other taken off.
    for (int round = 0; round < 2; ++round) {
      response.mode = deviation.fit(deviation.without(second), nats);
      second = deviation.fit(deviation.without(response.mode), nats);
    }
    response.second = second;
  }
  response.amplitude =
      response.second.amplitude > 0 ? std::abs(response.model(0)) : response.mode.amplitude;
  response.plain_nats = deviation.plain_nats();
  response.left_sd = deviation.left_sd([&](double t_s) { return response.model(t_s); });
  response.left_without_sd = deviation.left_sd([](double) { return 0; });
  return response;
}

double held_out_step_nats(const Bundle& bundle, const CleanSamples& clean,
                          const NoiseSpectrum& noise, const std::vector<double>& lines_hz) {
  std::array<StepResponse, 2> half;
  for (int k = 0; k < 2; ++k) {
    half[static_cast<std::size_t>(k)] =
        step_response(bundle, clean, noise, lines_hz,
                      [&](const Segment& segment) { return segment.pose % 2 == k; });
  }
  if (!half[0].usable || !half[1].usable) {
    return 0;
  }
  double nats = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const StepResponse& other = half[1 - k];
    for (std::size_t i = 0; i < other.share.size(); ++i) {
      const double model = half[k].model(static_cast<double>(i) / bundle.rate_hz);
      nats += 0.5 * (std::pow(other.share[i], 2) - std::pow(other.share[i] - model, 2)) /
              (other.sd * other.sd);
    }
  }
  return nats;
}

}  // namespace sixpoint::gap
