#include "gap/features/settling.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

namespace sixpoint::gap {

StepResponse step_response(const Bundle& bundle, const CleanSamples& clean,
                           const NoiseSpectrum& noise) {
  StepResponse response;
  const auto length = static_cast<std::size_t>(3 * bundle.rate_hz);
  response.share.assign(length, 0);
  std::vector<double> weight(length, 0);
  std::size_t steps = 0;
  for (const Segment& segment : bundle.segments) {
    if (segment.kind == Segment::Kind::vibration || !segment.starts_placement ||
        segment.samples < 2 * length || segment.approach_g.cwiseAbs().maxCoeff() < 0.2) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step_mg = 1000 * segment.approach_g[static_cast<Eigen::Index>(axis)];
      const double variance = noise.white_mg[axis] * noise.white_mg[axis];
      if (std::abs(step_mg) < 100 || !(variance > 0)) {
        continue;
      }
      const auto value = [&](std::size_t i) {
        return 1000.0 * clean.samples[segment.first_sample + i][axis] /
               bundle.accel_scale_lsb_per_g;
      };
      const auto good = [&](std::size_t i) {
        return (clean.flags[segment.first_sample + i] &
                (kSampleZero | kSampleHeld | kSampleClipped)) == 0;
      };
      double rest = 0;
      double n = 0;
      for (std::size_t i = length; i < std::min(segment.samples, 4 * length); ++i) {
        if (good(i)) {
          rest += value(i);
          n += 1;
        }
      }
      if (n < 100) {
        continue;
      }
      rest /= n;
      ++steps;
      for (std::size_t i = 0; i < length; ++i) {
        if (good(i)) {
          response.share[i] += step_mg * (value(i) - rest) / variance;
          weight[i] += step_mg * step_mg / variance;
        }
      }
    }
  }
  double most = 0;
  for (std::size_t i = 0; i < length; ++i) {
    most = std::max(most, weight[i]);
  }
  response.usable = steps >= 2 && most > 0;
  if (!response.usable) {
    return response;
  }
  response.sd = 1 / std::sqrt(most);
  for (std::size_t i = 0; i < length; ++i) {
    response.share[i] = weight[i] > 0.2 * most ? response.share[i] / weight[i] : 0;
    weight[i] = weight[i] > 0.2 * most ? weight[i] : 0;
  }
  const auto at_s = [&](std::size_t i) { return static_cast<double>(i) / bundle.rate_hz; };
  // Every frequency and decay on a grid; amplitude and phase in closed form.
  double best_c = 0;
  double best_s = 0;
  Eigen::Matrix2d best_a = Eigen::Matrix2d::Identity();
  const auto try_one = [&](double f, double decay) {
    Eigen::Matrix2d a = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < length; ++i) {
      const double e = std::exp(-at_s(i) / decay);
      if (e < 1e-3) {
        break;
      }
      const Eigen::Vector2d row(e * std::cos(2 * M_PI * f * at_s(i)),
                                -e * std::sin(2 * M_PI * f * at_s(i)));
      a += weight[i] * row * row.transpose();
      b += weight[i] * row * response.share[i];
    }
    a.diagonal().array() += 1e-9 * most;
    const Eigen::Vector2d x = a.ldlt().solve(b);
    const double gain = 0.5 * b.dot(x);
    if (gain > response.gain_nats) {
      response.gain_nats = gain;
      response.frequency_hz = f;
      response.decay_s = decay;
      best_c = x[0];
      best_s = x[1];
      best_a = a;
    }
  };
  for (const double decay : {0.1, 0.15, 0.2, 0.27, 0.36, 0.48, 0.65, 0.9}) {
    for (double f = 2; f <= std::min(20.0, 0.4 * bundle.rate_hz); f += 0.2) {
      try_one(f, decay);
    }
    double a = 0;
    double b = 0;
    for (std::size_t i = 0; i < length; ++i) {
      const double e = std::exp(-at_s(i) / decay);
      a += weight[i] * e * e;
      b += weight[i] * e * response.share[i];
    }
    response.plain_nats = std::max(response.plain_nats, 0.5 * b * b / a);
  }
  for (int round = 1; round <= 3; ++round) {
    const double f0 = response.frequency_hz;
    const double d0 = response.decay_s;
    for (int i = -4; i <= 4; ++i) {
      for (int k = -4; k <= 4; ++k) {
        try_one(std::max(0.5, f0 + i * 0.05 / round), std::max(0.03, d0 * (1 + k * 0.08 / round)));
      }
    }
  }
  response.amplitude = std::hypot(best_c, best_s);
  response.phase_rad = std::atan2(best_s, best_c);
  response.amplitude_sd = std::sqrt(best_a.inverse().diagonal().maxCoeff());
  const auto chi_over = [&](bool ringing) {
    double chi = 0;
    double n = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(bundle.rate_hz); ++i) {
      if (weight[i] > 0) {
        const double model =
            ringing ? std::exp(-at_s(i) / response.decay_s) * response.amplitude *
                          std::cos(2 * M_PI * response.frequency_hz * at_s(i) + response.phase_rad)
                    : 0;
        chi += weight[i] * std::pow(response.share[i] - model, 2);
        n += 1;
      }
    }
    return n > 0 ? (chi - n) / std::sqrt(2 * n) : 0;
  };
  response.left_sd = chi_over(true);
  response.left_without_sd = chi_over(false);
  return response;
}

}  // namespace sixpoint::gap
