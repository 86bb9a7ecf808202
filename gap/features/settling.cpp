#include "gap/features/settling.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>

namespace sixpoint::gap {

double StepResponse::Mode::at(double t_s) const {
  return amplitude == 0 ? 0
                        : amplitude * std::exp(-t_s / decay_s) *
                              std::cos(2 * M_PI * frequency_hz * t_s + phase_rad);
}

StepResponse step_response(const Bundle& bundle, const CleanSamples& clean,
                           const NoiseSpectrum& noise, double line_power_mg2,
                           const std::function<bool(const Segment&)>& use) {
  StepResponse response;
  const auto length = static_cast<std::size_t>(3 * bundle.rate_hz);
  response.share.assign(length, 0);
  std::vector<double> weight(length, 0);
  std::size_t steps = 0;
  for (const Segment& segment : bundle.segments) {
    if (segment.kind == Segment::Kind::vibration || !segment.starts_placement ||
        segment.samples < 2 * length || segment.approach_g.cwiseAbs().maxCoeff() < 0.2 ||
        (use && !use(segment))) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step_mg = 1000 * segment.approach_g[static_cast<Eigen::Index>(axis)];
      const double variance = noise.white_mg[axis] * noise.white_mg[axis] + line_power_mg2;
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
  const auto fit_mode = [&](const std::vector<double>& data, double& gain_nats) {
    StepResponse::Mode best;
    gain_nats = 0;
    const auto try_one = [&](double f, double decay) {
      Eigen::Matrix2d a = Eigen::Matrix2d::Zero();
      Eigen::Vector2d b = Eigen::Vector2d::Zero();
      for (std::size_t i = 0; i < length; ++i) {
        const double e = std::exp(-at_s(i) / decay);
        if (e < 1e-3) {
          break;
        }
        const double p = 2 * M_PI * f * at_s(i);
        const Eigen::Vector2d row(e * std::cos(p), -e * std::sin(p));
        a += weight[i] * row * row.transpose();
        b += weight[i] * row * data[i];
      }
      a.diagonal().array() += 1e-9 * most;
      const Eigen::Matrix2d inverse = a.inverse();
      const Eigen::Vector2d x = inverse * b;
      const double gain = 0.5 * b.dot(x);
      if (gain > gain_nats) {
        gain_nats = gain;
        best = {x.norm(), std::sqrt(inverse.diagonal().maxCoeff()), f, decay,
                std::atan2(x[1], x[0])};
      }
    };
    for (const double decay : {0.1, 0.15, 0.2, 0.27, 0.36, 0.48, 0.65, 0.9}) {
      const auto frequencies = static_cast<int>(4 * (std::min(30.0, 0.4 * bundle.rate_hz) - 2));
      for (int k = 0; k <= frequencies; ++k) {
        try_one(2 + 0.25 * k, decay);
      }
    }
    for (int round = 1; round <= 4; ++round) {
      const double f0 = best.frequency_hz;
      const double d0 = best.decay_s;
      for (int i = -3; i <= 3; ++i) {
        for (int k = -3; k <= 3; ++k) {
          try_one(std::max(0.5, f0 + i * 0.08 / round), std::max(0.03, d0 * (1 + k * 0.1 / round)));
        }
      }
    }
    return best;
  };
  const auto less = [&](const StepResponse::Mode& mode) {
    std::vector<double> data = response.share;
    for (std::size_t i = 0; i < length; ++i) {
      data[i] -= mode.at(at_s(i));
    }
    return data;
  };
  response.mode = fit_mode(response.share, response.gain_nats);
  StepResponse::Mode second = fit_mode(less(response.mode), response.second_nats);
  if (response.second_nats > 20) {
    // Each once more with the other taken off.
    double nats = 0;
    for (int round = 0; round < 2; ++round) {
      response.mode = fit_mode(less(second), nats);
      second = fit_mode(less(response.mode), nats);
    }
    response.second = second;
  }
  response.amplitude =
      response.second.amplitude > 0 ? std::abs(response.model(0)) : response.mode.amplitude;
  for (const double decay : {0.05, 0.1, 0.2, 0.4, 0.8}) {
    double a = 0;
    double b = 0;
    for (std::size_t i = 0; i < length; ++i) {
      const double e = std::exp(-at_s(i) / decay);
      a += weight[i] * e * e;
      b += weight[i] * e * response.share[i];
    }
    response.plain_nats = std::max(response.plain_nats, 0.5 * b * b / a);
  }
  const auto chi_over = [&](bool ringing) {
    double chi = 0;
    double n = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(bundle.rate_hz); ++i) {
      if (weight[i] > 0) {
        const double model = ringing ? response.model(at_s(i)) : 0;
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

double held_out_step_nats(const Bundle& bundle, const CleanSamples& clean,
                          const NoiseSpectrum& noise, double line_power_mg2) {
  std::array<StepResponse, 2> half;
  for (int k = 0; k < 2; ++k) {
    half[static_cast<std::size_t>(k)] =
        step_response(bundle, clean, noise, line_power_mg2,
                      [&](const Segment& segment) { return segment.pose % 2 == k; });
  }
  if (!half[0].usable || !half[1].usable) {
    return 0;
  }
  double nats = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const StepResponse& seen = half[k];
    const StepResponse& unseen = half[1 - k];
    for (std::size_t i = 0; i < unseen.share.size(); ++i) {
      const double model = seen.model(static_cast<double>(i) / bundle.rate_hz);
      nats += 0.5 * (std::pow(unseen.share[i], 2) - std::pow(unseen.share[i] - model, 2)) /
              (unseen.sd * unseen.sd);
    }
  }
  return nats;
}

}  // namespace sixpoint::gap
