#include "gap/features/slow_noise.h"

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace sixpoint::gap {
namespace {

struct Coefficient {
  double square;
  double white;    // variance of white noise in it
  double walk;     // variance per (mg per sqrt(s))^2
  double flicker;  // variance per mg^2/Hz at 1 Hz
};

}  // namespace

double flicker_density_mg2(double flicker_mg) { return flicker_mg * flicker_mg / (2 * M_PI); }

SlowNoise slow_noise(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  SlowNoise slow;
  std::vector<Coefficient> coefficients;
  const auto second = static_cast<std::size_t>(bundle.rate_hz);
  for (const Segment& segment : bundle.segments) {
    if (segment.kind == Segment::Kind::vibration || segment.kind == Segment::Kind::ramp ||
        second < 10) {
      continue;
    }
    const std::size_t skip = segment.starts_placement ? second : 0;
    const std::size_t blocks = segment.samples > skip ? (segment.samples - skip) / second : 0;
    if (blocks < 6) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Eigen::VectorXd y(static_cast<Eigen::Index>(blocks));
      bool whole = true;
      for (std::size_t b = 0; b < blocks && whole; ++b) {
        double sum = 0;
        double n = 0;
        for (std::size_t i = 0; i < second; ++i) {
          const std::size_t at = segment.first_sample + skip + b * second + i;
          if ((clean.flags[at] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0) {
            sum += 1000.0 * clean.samples[at][axis] / bundle.accel_scale_lsb_per_g;
            n += 1;
          }
        }
        whole = n > 0.9 * static_cast<double>(second);
        y[static_cast<Eigen::Index>(b)] = sum / std::max(1.0, n);
      }
      if (!whole) {
        continue;
      }
      const auto n = y.size();
      y.array() -= y.mean();
      Eigen::Index first = 1;
      if (n >= 60) {
        Eigen::MatrixXd trend(n, 3);
        for (Eigen::Index i = 0; i < n; ++i) {
          const double u = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1;
          trend.row(i) << 1, u, u * u;
        }
        y -= trend * trend.householderQr().solve(y);
        first = 4;
      }
      // 300 coefficients reach from the record's length to a few seconds: the rest is white.
      const Eigen::Index last = std::min<Eigen::Index>(n, 300);
      const double white = std::pow(noise.white_mg[axis], 2) / static_cast<double>(second);
      for (Eigen::Index k = first; k < last; ++k) {
        double c = 0;
        const double w = M_PI * static_cast<double>(k) / static_cast<double>(n);
        for (Eigen::Index i = 0; i < n; ++i) {
          c += y[i] * std::cos(w * (static_cast<double>(i) + 0.5));
        }
        c *= std::sqrt(2.0 / static_cast<double>(n));
        const double s2 = std::pow(std::sin(w / 2), 2);
        coefficients.push_back({c * c, white, (1 - 2.0 / 3.0 * s2) / (4 * s2),
                                static_cast<double>(n) / static_cast<double>(k)});
      }
    }
  }
  slow.coefficients = coefficients.size();
  slow.walk_mg = {0, 0.02, 0.03, 0.045, 0.065, 0.09, 0.12, 0.16, 0.2, 0.25, 0.3, 0.38, 0.5, 0.8};
  slow.flicker_mg = {0, 0.08, 0.12, 0.17, 0.23, 0.3, 0.4, 0.5, 0.65, 0.8, 1, 1.3, 1.8, 2.5};
  slow.nats.assign(slow.walk_mg.size(), std::vector<double>(slow.flicker_mg.size(), 0));
  double base = 0;
  for (const Coefficient& c : coefficients) {
    base += -0.5 * (std::log(c.white) + c.square / c.white);
  }
  double best = -1e300;
  for (std::size_t i = 0; i < slow.walk_mg.size(); ++i) {
    for (std::size_t j = 0; j < slow.flicker_mg.size(); ++j) {
      const double q2 = slow.walk_mg[i] * slow.walk_mg[i];
      const double density = flicker_density_mg2(slow.flicker_mg[j]);
      double sum = 0;
      double chi = 0;
      for (const Coefficient& c : coefficients) {
        const double v = c.white + q2 * c.walk + density * c.flicker;
        sum += -0.5 * (std::log(v) + c.square / v);
        chi += c.square / v;
      }
      slow.nats[i][j] = sum - base;
      if (sum > best && !coefficients.empty()) {
        best = sum;
        const auto n = static_cast<double>(coefficients.size());
        slow.misfit_sd = (chi - n) / std::sqrt(2 * n);
      }
    }
  }
  return slow;
}

SlowNoise::Best SlowNoise::best_walk() const {
  Best best;
  for (std::size_t i = 0; i < walk_mg.size(); ++i) {
    if (nats[i][0] > best.nats) {
      best = {walk_mg[i], 0, nats[i][0]};
    }
  }
  return best;
}

SlowNoise::Best SlowNoise::best_flicker() const {
  Best best;
  for (std::size_t j = 0; j < flicker_mg.size(); ++j) {
    if (nats[0][j] > best.nats) {
      best = {0, flicker_mg[j], nats[0][j]};
    }
  }
  return best;
}

SlowNoise::Best SlowNoise::best_both() const {
  Best best;
  for (std::size_t i = 0; i < walk_mg.size(); ++i) {
    for (std::size_t j = 0; j < flicker_mg.size(); ++j) {
      if (nats[i][j] > best.nats) {
        best = {walk_mg[i], flicker_mg[j], nats[i][j]};
      }
    }
  }
  return best;
}

}  // namespace sixpoint::gap
