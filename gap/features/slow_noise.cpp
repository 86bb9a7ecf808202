#include "gap/features/slow_noise.h"

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace sixpoint::gap {
namespace {

struct Coefficient {
  double square;
  double white;    // variance of white noise in it
  double walk;     // variance per (mg per sqrt(s))^2
  double flicker;  // variance per mg^2/Hz at 1 Hz
  int octave;      // of its period in seconds
};

}  // namespace

double flicker_density_mg2(double flicker_mg) { return flicker_mg * flicker_mg; }

SlowNoise slow_noise(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  SlowNoise slow;
  std::vector<Coefficient> coefficients;
  // Per axis and width: count, squares, fourth powers of differences between neighbouring means.
  constexpr std::array<Eigen::Index, 2> kWidths_s = {3, 8};
  std::array<std::array<std::array<double, 3>, 2>, 3> moments{};
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
      for (std::size_t k = 0; k < kWidths_s.size(); ++k) {
        const Eigen::Index width = kWidths_s[k];
        for (Eigen::Index i = 2; i + 2 * width <= n; i += width) {  // the ringing of a move is over
          const double d = y.segment(i + width, width).mean() - y.segment(i, width).mean();
          moments[axis][k][0] += 1;
          moments[axis][k][1] += d * d;
          moments[axis][k][2] += d * d * d * d;
        }
      }
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
                                static_cast<double>(n) / static_cast<double>(k),
                                static_cast<int>(std::floor(std::log2(2.0 * static_cast<double>(n) /
                                                                      static_cast<double>(k))))});
      }
    }
  }
  for (const auto& widths : moments) {
    for (const auto& [count, squares, fourths] : widths) {
      if (count > 30) {
        const double excess = fourths * count / (squares * squares) - 3;
        // Neighbouring differences share a mean: a third more scatter than independent ones.
        slow.jump_sd = std::max(slow.jump_sd, excess / std::sqrt(32 / count));
      }
    }
  }
  slow.coefficients = coefficients.size();
  slow.walk_mg = {0, 0.02, 0.03, 0.045, 0.065, 0.09, 0.12, 0.16, 0.2, 0.25, 0.3, 0.38, 0.5, 0.8};
  slow.flicker_mg = {0, 0.02, 0.035, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2.2};
  slow.nats.assign(slow.walk_mg.size(), std::vector<double>(slow.flicker_mg.size(), 0));
  double base = 0;
  for (const Coefficient& c : coefficients) {
    base += -0.5 * (std::log(c.white) + c.square / c.white);
  }
  std::map<int, std::array<double, 2>> octaves;  // sum of square over white, count
  for (const Coefficient& c : coefficients) {
    auto& octave = octaves[c.octave];
    octave[0] += c.square / c.white;
    octave[1] += 1;
  }
  for (const auto& [octave, sum] : octaves) {
    const double ratio = std::max(1.0, sum[0] / sum[1]);
    slow.free_nats += 0.5 * (sum[0] - sum[0] / ratio - sum[1] * std::log(ratio)) - 2;
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
