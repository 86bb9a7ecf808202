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
  std::size_t axis;
};

double log_mean(const std::vector<double>& nats) {
  double high = -1e300;
  for (const double x : nats) {
    high = std::max(high, x);
  }
  double sum = 0;
  for (const double x : nats) {
    sum += std::exp(x - high);
  }
  return high + std::log(sum / static_cast<double>(std::max<std::size_t>(1, nats.size())));
}

constexpr std::array<double, 5> kWalks_mg = {0.05, 0.1, 0.2, 0.4, 0.8};
constexpr std::array<double, 5> kFlickers_mg = {0.1, 0.2, 0.4, 0.8, 1.6};
constexpr std::array<double, 3> kJumps_mg = {0.6, 2, 6};
constexpr std::array<double, 3> kJumpRates = {0.05, 0.2, 0.6};  // per piece

// What makes a short piece of a record, its level free: sums over pieces, over white noise alone.
class PieceEvidence {
 public:
  void add(const Eigen::VectorXd& piece, double white) {
    const Eigen::Index n = piece.size();
    const Eigen::VectorXd y = piece.array() - piece.mean();
    for (Eigen::Index k = 1; k < n; ++k) {
      double c = 0;
      const double w = M_PI * static_cast<double>(k) / static_cast<double>(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        c += y[i] * std::cos(w * (static_cast<double>(i) + 0.5));
      }
      const double square = c * c * 2.0 / static_cast<double>(n);
      const double s2 = std::pow(std::sin(w / 2), 2);
      const auto gain = [&](double variance) {
        const double v = white + variance;
        return -0.5 * (std::log(v / white) + square / v - square / white);
      };
      for (std::size_t i = 0; i < kWalks_mg.size(); ++i) {
        walk_[i] += gain(kWalks_mg[i] * kWalks_mg[i] * (1 - 2.0 / 3.0 * s2) / (4 * s2));
        flicker_[i] += gain(flicker_density_mg2(kFlickers_mg[i]) * static_cast<double>(n) /
                            static_cast<double>(k));
      }
    }
    for (std::size_t s = 0; s < kJumps_mg.size(); ++s) {
      // One jump at an unknown second, its size Gaussian.
      std::vector<double> at;
      double before = 0;
      for (Eigen::Index i = 1; i < n; ++i) {
        before += y[i - 1];
        const auto left = static_cast<double>(i);
        const auto right = static_cast<double>(n - i);
        const double a = left * right / static_cast<double>(n) / white;
        const double step = -before / right - before / left;
        const double b = a * step;
        const double prior = kJumps_mg[s] * kJumps_mg[s];
        at.push_back(0.5 * b * b / (a + 1 / prior) - 0.5 * std::log1p(a * prior));
      }
      const double jump = log_mean(at);
      for (std::size_t r = 0; r < kJumpRates.size(); ++r) {
        const double high = std::max(0.0, jump);
        jump_[kJumpRates.size() * s + r] += high + std::log((1 - kJumpRates[r]) * std::exp(-high) +
                                                            kJumpRates[r] * std::exp(jump - high));
      }
    }
  }
  double jump_over_noise() const {
    return log_mean(jump_) - std::max({0.0, log_mean(walk_), log_mean(flicker_)});
  }

 private:
  std::vector<double> walk_ = std::vector<double>(kWalks_mg.size(), 0);
  std::vector<double> flicker_ = std::vector<double>(kFlickers_mg.size(), 0);
  std::vector<double> jump_ = std::vector<double>(kJumps_mg.size() * kJumpRates.size(), 0);
};

}  // namespace

double flicker_density_mg2(double flicker_mg) { return flicker_mg * flicker_mg; }

SlowNoise slow_noise(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  SlowNoise slow;
  std::vector<Coefficient> coefficients;
  // Per axis and width: count, squares, fourth powers of differences between neighbouring means.
  constexpr std::array<Eigen::Index, 2> kWidths_s = {3, 8};
  std::array<std::array<std::array<double, 3>, 2>, 3> moments{};
  PieceEvidence pieces;
  const auto second = static_cast<std::size_t>(bundle.rate_hz);
  for (const Segment& segment : bundle.segments) {
    const std::size_t first_mode = slow.modes.size();
    if (segment.kind == Segment::Kind::vibration || segment.kind == Segment::Kind::ramp ||
        second < 10) {
      continue;
    }
    const std::size_t skip = segment.may_ring() ? second : 0;
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
      constexpr Eigen::Index kPiece_s = 10;
      const double white = std::pow(noise.white_mg[axis], 2) / static_cast<double>(second);
      for (Eigen::Index i = 0; i < n; i += kPiece_s) {
        if (const Eigen::Index size = std::min(kPiece_s, n - i); size >= 6) {
          pieces.add(y.segment(i, size), white);
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
                                                                      static_cast<double>(k)))),
                                axis});
        const std::size_t mode = first_mode + static_cast<std::size_t>(k - first);
        if (mode >= slow.modes.size()) {
          slow.modes.emplace_back();
        }
        SlowNoise::Mode& here = slow.modes[mode];
        here.value_mg[axis] = c;
        here.white_mg2[axis] = white;
        here.walk = coefficients.back().walk;
        here.flicker = coefficients.back().flicker;
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
  slow.jump_nats = pieces.jump_over_noise();
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
        slow.axis_sd = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          double own = 0;
          double count = 0;
          for (const Coefficient& c : coefficients) {
            if (c.axis == axis) {
              own += c.square / (c.white + q2 * c.walk + density * c.flicker);
              count += 1;
            }
          }
          slow.axis_sd = count > 20 ? std::max(slow.axis_sd, (own - count) / std::sqrt(2 * count))
                                    : slow.axis_sd;
        }
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
