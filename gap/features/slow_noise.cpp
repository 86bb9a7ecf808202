#include "gap/features/slow_noise.h"

#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

namespace sixpoint::gap {
namespace {

struct Coefficient {
  double value_mg;
  double white_mg2;  // variance of white noise in it
  double walk;       // variance per (mg per sqrt(s))^2
  double flicker;    // variance per mg^2/Hz at 1 Hz
  int octave;        // of its period in seconds
  std::size_t axis;

  double square() const { return value_mg * value_mg; }
  double variance(double walk_mg, double flicker_mg) const {
    return white_mg2 + walk_mg * walk_mg * walk + flicker_density_mg2(flicker_mg) * flicker;
  }
};

// Coefficient k of the cosine transform of y, not normalised.
double cosine_sum(const Eigen::VectorXd& y, double w) {
  double c = 0;
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    c += y[i] * std::cos(w * (static_cast<double>(i) + 0.5));
  }
  return c;
}

// Variance of a random walk of this power (mg^2/s), averaged over seconds, in that coefficient.
double walk_variance(double w, double power = 1) {
  const double s2 = std::pow(std::sin(w / 2), 2);
  return power * (1 - 2.0 / 3.0 * s2) / (4 * s2);
}

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

// Sizes and rates for the evidence of jumps: from a third to three times the catalogue's, a factor
// of two to three apart (convention).
constexpr std::array<double, 5> kWalks_mg = {0.05, 0.1, 0.2, 0.4, 0.8};
constexpr std::array<double, 5> kFlickers_mg = {0.1, 0.2, 0.4, 0.8, 1.6};
constexpr std::array<double, 3> kJumps_mg = {0.6, 2, 6};
constexpr std::array<double, 3> kJumpRates = {0.05, 0.2, 0.6};  // per piece
constexpr std::array<Eigen::Index, 2> kWidths_s = {3, 8};

// Log likelihoods of a short piece of a record, its level free, over white noise alone, for each
// cause of slow noise; summed over pieces.
class PieceEvidence {
 public:
  void add(const Eigen::VectorXd& piece, double white) {
    const Eigen::VectorXd y = piece.array() - piece.mean();
    add_noise(y, white);
    for (std::size_t s = 0; s < kJumps_mg.size(); ++s) {
      const double jump = jump_nats(y, kJumps_mg[s] * kJumps_mg[s], white);
      const double high = std::max(0.0, jump);
      for (std::size_t r = 0; r < kJumpRates.size(); ++r) {
        jump_[kJumpRates.size() * s + r] += high + std::log((1 - kJumpRates[r]) * std::exp(-high) +
                                                            kJumpRates[r] * std::exp(jump - high));
      }
    }
  }
  double jump_over_noise() const {
    return log_mean(jump_) - std::max({0.0, log_mean(walk_), log_mean(flicker_)});
  }

 private:
  void add_noise(const Eigen::VectorXd& y, double white) {
    const auto n = static_cast<double>(y.size());
    for (Eigen::Index k = 1; k < y.size(); ++k) {
      const double w = M_PI * static_cast<double>(k) / n;
      const double c = cosine_sum(y, w);
      const double square = c * c * 2.0 / n;
      const auto gain = [&](double variance) {
        const double v = white + variance;
        return -0.5 * (std::log(v / white) + square / v - square / white);
      };
      for (std::size_t i = 0; i < kWalks_mg.size(); ++i) {
        walk_[i] += gain(walk_variance(w, kWalks_mg[i] * kWalks_mg[i]));
        flicker_[i] += gain(flicker_density_mg2(kFlickers_mg[i]) * n / static_cast<double>(k));
      }
    }
  }

  // One jump at an unknown second, its size Gaussian of this variance.
  static double jump_nats(const Eigen::VectorXd& y, double variance, double white) {
    std::vector<double> at;
    double before = 0;
    for (Eigen::Index i = 1; i < y.size(); ++i) {
      before += y[i - 1];
      const auto left = static_cast<double>(i);
      const auto right = static_cast<double>(y.size() - i);
      const double a = left * right / static_cast<double>(y.size()) / white;
      const double b = a * (-before / right - before / left);
      at.push_back(0.5 * b * b / (a + 1 / variance) - 0.5 * std::log1p(a * variance));
    }
    return log_mean(at);
  }

  std::vector<double> walk_ = std::vector<double>(kWalks_mg.size(), 0);
  std::vector<double> flicker_ = std::vector<double>(kFlickers_mg.size(), 0);
  std::vector<double> jump_ = std::vector<double>(kJumps_mg.size() * kJumpRates.size(), 0);
};

// Differences between neighbouring means, of one axis and width.
class Differences {
 public:
  void add(const Eigen::VectorXd& y, Eigen::Index width) {
    constexpr Eigen::Index kRinging_s = 2;
    for (Eigen::Index i = kRinging_s; i + 2 * width <= y.size(); i += width) {
      const double d = y.segment(i + width, width).mean() - y.segment(i, width).mean();
      count_ += 1;
      squares_ += d * d;
      fourths_ += d * d * d * d;
    }
  }
  // Excess kurtosis in sd. Neighbouring differences share a mean: a third more scatter than
  // independent ones, 32 / n in place of 24 / n.
  double excess_sd() const {
    return count_ > 30 ? (fourths_ * count_ / (squares_ * squares_) - 3) / std::sqrt(32 / count_)
                       : 0;
  }

 private:
  double count_ = 0, squares_ = 0, fourths_ = 0;
};

// Means over seconds of one axis from sample `first` on; empty where more than a tenth of one is
// masked.
Eigen::VectorXd second_means(const CleanSamples& clean, std::size_t first, std::size_t seconds,
                             std::size_t rate, std::size_t axis) {
  Eigen::VectorXd y(static_cast<Eigen::Index>(seconds));
  for (std::size_t b = 0; b < seconds; ++b) {
    const std::size_t at = first + b * rate;
    if (static_cast<double>(clean.count_usable(at, rate)) <= 0.9 * static_cast<double>(rate)) {
      return {};
    }
    y[static_cast<Eigen::Index>(b)] = clean.mean_mg(at, rate, axis);
  }
  return y;
}

// Takes the mean off, and a parabola off records of a minute and more. The first coefficient that
// still shows noise.
Eigen::Index take_off_trend(Eigen::VectorXd& y) {
  constexpr Eigen::Index kLong_s = 60;
  const Eigen::Index n = y.size();
  y.array() -= y.mean();
  if (n < kLong_s) {
    return 1;
  }
  Eigen::MatrixXd trend(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1;
    trend.row(i) << 1, u, u * u;
  }
  y -= trend * trend.householderQr().solve(y);
  return 4;
}

// All that a recording's records say of slow noise, before anything is fitted.
struct SlowRecords {
  std::vector<Coefficient> coefficients;
  std::vector<SlowNoise::Mode> modes;
  PieceEvidence pieces;
  // Per axis and width.
  std::array<std::array<Differences, kWidths_s.size()>, 3> differences;

  void add(const Eigen::VectorXd& means, std::size_t axis, double white, std::size_t first_mode) {
    constexpr Eigen::Index kPiece_s = 10;
    constexpr Eigen::Index kShortest_s = 6;
    const Eigen::Index n = means.size();
    for (std::size_t k = 0; k < kWidths_s.size(); ++k) {
      differences[axis][k].add(means, kWidths_s[k]);
    }
    for (Eigen::Index i = 0; i < n; i += kPiece_s) {
      if (const Eigen::Index size = std::min(kPiece_s, n - i); size >= kShortest_s) {
        pieces.add(means.segment(i, size), white);
      }
    }
    Eigen::VectorXd y = means;
    const Eigen::Index first = take_off_trend(y);
    // 300 coefficients reach from the record's length to a few seconds: the rest is white.
    for (Eigen::Index k = first; k < std::min<Eigen::Index>(n, 300); ++k) {
      const double w = M_PI * static_cast<double>(k) / static_cast<double>(n);
      const double period_s = 2.0 * static_cast<double>(n) / static_cast<double>(k);
      const double c = cosine_sum(y, w) * std::sqrt(2.0 / static_cast<double>(n));
      coefficients.push_back({c, white, walk_variance(w),
                              static_cast<double>(n) / static_cast<double>(k),
                              static_cast<int>(std::floor(std::log2(period_s))), axis});
      const std::size_t mode = first_mode + static_cast<std::size_t>(k - first);
      modes.resize(std::max(modes.size(), mode + 1));
      modes[mode].value_mg[axis] = c;
      modes[mode].white_mg2[axis] = white;
      modes[mode].walk = coefficients.back().walk;
      modes[mode].flicker = coefficients.back().flicker;
    }
  }
};

SlowRecords read_records(const Bundle& bundle, const CleanSamples& clean,
                         const NoiseSpectrum& noise) {
  constexpr std::size_t kShortest_s = 6;
  SlowRecords records;
  const auto rate = static_cast<std::size_t>(bundle.rate_hz);
  for (const Segment& segment : bundle.segments) {
    const std::size_t first_mode = records.modes.size();
    const std::size_t skip = segment.may_ring() ? rate : 0;
    if (!segment.at_rest() || segment.kind == Segment::Kind::ramp || rate < 10 ||
        segment.samples < skip + kShortest_s * rate) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Eigen::VectorXd means = second_means(clean, segment.first_sample + skip,
                                                 (segment.samples - skip) / rate, rate, axis);
      if (means.size() > 0) {
        records.add(means, axis, std::pow(noise.white_mg[axis], 2) / static_cast<double>(rate),
                    first_mode);
      }
    }
  }
  return records;
}

// Power over what the model has, in sd of its chi-square; of one axis, or of all.
double misfit_sd(const std::vector<Coefficient>& coefficients, double walk_mg, double flicker_mg,
                 std::optional<std::size_t> axis, double least) {
  double chi = 0;
  double n = 0;
  for (const Coefficient& c : coefficients) {
    if (!axis || c.axis == *axis) {
      chi += c.square() / c.variance(walk_mg, flicker_mg);
      n += 1;
    }
  }
  return n > least ? (chi - n) / std::sqrt(2 * n) : 0;
}

// Of a spectrum free in every octave, over white noise alone; an octave costs two nats.
double free_spectrum_nats(const std::vector<Coefficient>& coefficients) {
  constexpr double kOctaveCost_nats = 2;
  std::map<int, std::array<double, 2>> octaves;  // sum of square over white, count
  for (const Coefficient& c : coefficients) {
    auto& [sum, count] = octaves[c.octave];
    sum += c.square() / c.white_mg2;
    count += 1;
  }
  double nats = 0;
  for (const auto& [octave, total] : octaves) {
    const auto& [sum, count] = total;
    const double ratio = std::max(1.0, sum / count);
    nats += 0.5 * (sum - sum / ratio - count * std::log(ratio)) - kOctaveCost_nats;
  }
  return nats;
}

}  // namespace

double SlowNoise::expected_nats(bool flicker, double size, double tried) const {
  double sum_nats = 0;
  for (const Mode& mode : modes) {
    const double per_size2 = flicker ? mode.flicker : mode.walk;
    for (const double white_mg2 : mode.white_mg2) {
      if (white_mg2 > 0) {
        const double ratio = tried * tried * per_size2 / white_mg2;
        const double variance = 1 + size * size * per_size2 / white_mg2;
        sum_nats += 0.5 * (variance * ratio / (1 + ratio) - std::log1p(ratio));
      }
    }
  }
  return sum_nats;
}

double flicker_density_mg2(double flicker_mg) { return flicker_mg * flicker_mg; }

SlowNoise slow_noise(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  constexpr double kFewest = 20;  // coefficients of one axis
  const SlowRecords records = read_records(bundle, clean, noise);
  const std::vector<Coefficient>& coefficients = records.coefficients;
  SlowNoise slow;
  for (const auto& widths : records.differences) {
    for (const Differences& differences : widths) {
      slow.jump_sd = std::max(slow.jump_sd, differences.excess_sd());
    }
  }
  slow.modes = records.modes;
  slow.jump_nats = records.pieces.jump_over_noise();
  slow.free_nats = free_spectrum_nats(coefficients);
  slow.walk_mg = {0,   0.02, 0.03, 0.045, 0.065, 0.09, 0.12, 0.16,
                  0.2, 0.25, 0.3,  0.38,  0.5,   0.8,  1.3};
  slow.flicker_mg = {0, 0.02, 0.035, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2.2};
  const auto log_likelihood = [&](double walk_mg, double flicker_mg) {
    double sum = 0;
    for (const Coefficient& c : coefficients) {
      const double v = c.variance(walk_mg, flicker_mg);
      sum += -0.5 * (std::log(v) + c.square() / v);
    }
    return sum;
  };
  const double base = log_likelihood(0, 0);
  for (const double walk_mg : slow.walk_mg) {
    slow.nats.emplace_back();
    for (const double flicker_mg : slow.flicker_mg) {
      slow.nats.back().push_back(log_likelihood(walk_mg, flicker_mg) - base);
    }
  }
  const SlowNoise::Best best = slow.best();
  slow.misfit_sd = misfit_sd(coefficients, best.walk_mg, best.flicker_mg, std::nullopt, 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    slow.axis_sd = std::max(slow.axis_sd,
                            misfit_sd(coefficients, best.walk_mg, best.flicker_mg, axis, kFewest));
  }
  return slow;
}

SlowNoise::Best SlowNoise::best() const {
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
