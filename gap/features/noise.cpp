#include "gap/features/noise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <iterator>
#include <map>
#include <unsupported/Eigen/FFT>

#include "gap/recording/at_rest.h"
#include "gap/recording/median.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kEnoughBlocks = 30;  // their level is known to 2 %
constexpr std::size_t kMaxBlocks = 1200;   // the level is then known to 0.1 %

// First samples of undisturbed blocks; of those in which the clock doesn't slip, if they are
// enough: a slip spreads a line over the spectrum.
std::vector<std::size_t> block_starts(const Bundle& bundle, const CleanSamples& clean,
                                      std::size_t length) {
  std::vector<std::size_t> starts;
  std::vector<std::size_t> in_step;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    for (const RestPiece& piece : rest_pieces(bundle, s, length)) {
      if (clean.count_usable(piece.first, piece.samples) != length) {
        continue;
      }
      starts.push_back(piece.first);
      const auto from = clean.flags.begin() + static_cast<std::ptrdiff_t>(piece.first);
      if (std::none_of(from, from + static_cast<std::ptrdiff_t>(length),
                       [](std::uint8_t flag) { return (flag & kSampleSlipped) != 0; })) {
        in_step.push_back(piece.first);
      }
    }
  }
  return in_step.size() >= kEnoughBlocks ? in_step : starts;
}

struct Moments {
  double mean_mg = 0;
  double variance_mg2 = 0;
};

Moments moments_of(const CleanSamples& clean, std::size_t first, std::size_t samples,
                   std::size_t axis) {
  const auto n = static_cast<double>(samples);
  double sum = 0;
  double squares = 0;
  for (std::size_t i = first; i < first + samples; ++i) {
    const double x = clean.value_mg(i, axis);
    sum += x;
    squares += x * x;
  }
  return {sum / n, squares / n - sum * sum / (n * n)};
}

// The blocks that show an axis' noise as it is: all, or, where those about zero have clearly less,
// the others. (Numbers that are truncated toward zero are zero over two counts.)
std::vector<std::size_t> blocks_of_axis(const CleanSamples& clean,
                                        const std::vector<std::size_t>& starts, std::size_t length,
                                        std::size_t axis) {
  constexpr double kAway_lsb = 5;  // of noise of one
  constexpr double kLess = 0.8;    // five blocks know their variance to 5 %
  constexpr std::size_t kLeast = 5;
  const double away_mg = kAway_lsb * 1000 / clean.accel_scale_lsb_per_g;
  std::vector<std::size_t> away;
  double far_mg2 = 0;
  double near_mg2 = 0;
  for (const std::size_t start : starts) {
    const Moments m = moments_of(clean, start, length, axis);
    if (std::abs(m.mean_mg) > away_mg) {
      away.push_back(start);
      far_mg2 += m.variance_mg2;
    } else {
      near_mg2 += m.variance_mg2;
    }
  }
  const std::size_t near = starts.size() - away.size();
  const bool less =
      away.size() >= kLeast && near >= kLeast &&
      near_mg2 / static_cast<double>(near) < kLess * far_mg2 / static_cast<double>(away.size());
  return less ? away : starts;
}

// Median of the variance where the unit's noise is white: below its filter, above its slow noise.
double white_level(const NoiseSpectrum& spectrum, std::size_t axis, double rate_hz) {
  std::vector<double> lowest;
  for (std::size_t k = 0; k < spectrum.frequency_hz.size(); ++k) {
    if (spectrum.frequency_hz[k] < std::max(8.0, 0.08 * rate_hz)) {
      lowest.push_back(spectrum.variance_mg2[axis][k]);
    }
  }
  return lowest.empty() ? 0 : std::sqrt(upper_median(lowest));
}

}  // namespace

double NoiseSpectrum::variance_at(std::size_t axis, double at_hz) const {
  if (frequency_hz.empty()) {
    return 0;
  }
  const auto middle =
      static_cast<std::ptrdiff_t>(std::lround((at_hz - frequency_hz.front()) / step_hz));
  const auto last = static_cast<std::ptrdiff_t>(frequency_hz.size()) - 1;
  std::vector<double> near;  // nine bins: a line fills three of them at most
  for (std::ptrdiff_t k = middle - 4; k <= middle + 4; ++k) {
    near.push_back(
        variance_mg2[axis][static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last))]);
  }
  return upper_median(near);
}

NoiseSpectrum noise_spectrum(const Bundle& bundle, const CleanSamples& clean) {
  constexpr std::size_t kLow = 3;  // the window spreads the mean over the bins below
  NoiseSpectrum spectrum;
  const auto length = static_cast<std::size_t>(2 * bundle.rate_hz);
  if (length < 20) {
    return spectrum;
  }
  spectrum.step_hz = bundle.rate_hz / static_cast<double>(length);
  std::vector<double> window(length);
  double power = 0;
  for (std::size_t i = 0; i < length; ++i) {
    window[i] = 0.5 - 0.5 * std::cos(2 * M_PI * (static_cast<double>(i) + 0.5) /
                                     static_cast<double>(length));
    power += window[i] * window[i];
  }
  const std::vector<std::size_t> all = block_starts(bundle, clean, length);
  const std::size_t high = length / 2;
  for (std::size_t k = kLow; k < high; ++k) {
    spectrum.frequency_hz.push_back(static_cast<double>(k) * spectrum.step_hz);
  }
  spectrum.blocks = kMaxBlocks;  // of the axis that has fewest
  Eigen::FFT<double> fft;
  std::vector<double> x(length);
  std::vector<std::complex<double>> out;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double>& variance = spectrum.variance_mg2[axis];
    variance.assign(high - kLow, 0);
    const std::vector<std::size_t> starts = blocks_of_axis(clean, all, length, axis);
    const std::size_t stride =
        std::max<std::size_t>(1, (starts.size() + kMaxBlocks - 1) / kMaxBlocks);
    const std::size_t blocks = (starts.size() + stride - 1) / stride;
    spectrum.blocks = std::min(spectrum.blocks, blocks);
    for (std::size_t b = 0; b < starts.size(); b += stride) {
      double mean = 0;
      for (std::size_t i = 0; i < length; ++i) {
        x[i] = clean.value_mg(starts[b] + i, axis);
        mean += x[i];
      }
      mean /= static_cast<double>(length);
      for (std::size_t i = 0; i < length; ++i) {
        x[i] = (x[i] - mean) * window[i];
      }
      fft.fwd(out, x);
      for (std::size_t k = kLow; k < high; ++k) {
        variance[k - kLow] += std::norm(out[k]) / power;
      }
    }
    if (blocks > 0) {
      for (double& v : variance) {
        v /= static_cast<double>(blocks);
      }
      spectrum.white_mg[axis] = white_level(spectrum, axis, bundle.rate_hz);
    }
  }
  return spectrum;
}

namespace {

// How often a code was stored, and how often Gaussian noise about the dwells' means would have it.
struct CodeCount {
  double seen = 0;
  double expected = 0;
  double variance = 0;
};

// Codes of `samples` values of this mean and variance (as stored, in LSB).
void expect_codes(double mean, double variance, double samples, std::map<int, CodeCount>& codes) {
  const double sd = std::sqrt(std::max(0.01, variance - 1.0 / 12));  // of what was rounded
  const auto below = [&](double x) { return 0.5 * std::erfc((mean - x) / (sd * M_SQRT2)); };
  const int reach = static_cast<int>(std::min(50.0, std::ceil(4 * sd)));
  const int middle = static_cast<int>(std::lround(mean));
  for (int code = middle - reach; code <= middle + reach; ++code) {
    const double share = below(code + 0.5) - below(code - 0.5);
    CodeCount& count = codes[code];
    count.expected += samples * share;
    count.variance += samples * share * (1 - share);
  }
}

// Long records in pieces, so that slow drift does not count as noise; every fourth is enough.
std::vector<RestPiece> pieces_of(const Bundle& bundle) {
  constexpr double kPiece_s = 7;
  constexpr double kSettledPiece_s = 5;  // a jig's readings are shorter
  std::vector<RestPiece> pieces;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const Segment& segment = bundle.segments[s];
    const auto length =
        static_cast<std::size_t>((segment.settled ? kSettledPiece_s : kPiece_s) * bundle.rate_hz);
    const std::size_t every = segment.samples > 4 * length ? 4 : 1;
    std::ranges::copy_if(rest_pieces(bundle, s, length, every), std::back_inserter(pieces),
                         [&](const RestPiece& piece) { return piece.samples == length; });
  }
  return pieces;
}

// Sums over all pieces, and what follows from them.
class CodeSums {
 public:
  explicit CodeSums(const CleanSamples& clean) : clean_(clean) {}

  void add(const RestPiece& piece) {
    constexpr double kLeast = 100;  // samples: a variance is then known to 14 %
    std::array<double, 3> sum{}, square{}, odd{};
    double n = 0;
    const std::size_t last = piece.first + piece.samples;
    for (std::size_t at = piece.first; at < last; ++at) {
      if (!clean_.usable(at)) {
        continue;
      }
      n += 1;
      const gt3x::Counts& x = clean_.samples[at];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        sum[axis] += x[axis];
        square[axis] += static_cast<double>(x[axis]) * x[axis];
        odd[axis] += (x[axis] & 1) != 0 ? 1 : 0;
      }
      count_repeats(piece, at);
    }
    if (n < kLeast) {
      return;
    }
    codes_.samples += static_cast<std::size_t>(n);
    std::array<double, 3> mean{}, sd{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mean[axis] = sum[axis] / n;
      const double variance = std::max(1e-12, square[axis] / n - mean[axis] * mean[axis]);
      sd[axis] = std::sqrt(variance);
      dwells_[axis].push_back({piece.segment, variance, n});
      odd_[axis] += odd[axis] - n / 2;
      // By the sampling of Gaussian noise on the grid of integers the odd share is off by at most
      // exp(-pi^2 variance / 2), with the sign of where the mean lies: one sign in the worst case.
      parity_variance_[axis] += n / 4;
      parity_grid_[axis] += std::exp(-M_PI * M_PI * variance / 2) * n * 2 / M_PI;
      expect_codes(mean[axis], variance, n, by_code_[axis]);
    }
    for (std::size_t at = piece.first; at < last; ++at) {
      if (clean_.usable(at)) {
        add_deviations(clean_.samples[at], mean, sd);
      }
    }
  }

  CodeStatistics finish() {
    if (codes_.samples == 0) {
      return codes_;
    }
    const auto n = static_cast<double>(codes_.samples);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      codes_.odd_share[axis] = 0.5 + odd_[axis] / n;
      codes_.parity_sd[axis] = (std::sqrt(parity_variance_[axis]) + parity_grid_[axis] / 2) / n;
      find_odd_code(axis);
    }
    if (pairs_ > 0) {
      codes_.repeats_excess_sd = (repeats_ - repeats_far_) / std::sqrt(repeats_ + repeats_far_ + 1);
    }
    if (fourth_n_ > 0) {
      codes_.kurtosis_sd = fourth_ / fourth_n_ / std::sqrt(24 / fourth_n_);
    }
    for (const double c : cross_) {
      const double z = c / std::sqrt(n);
      if (std::abs(z) > std::abs(codes_.cross_correlation_sd)) {
        codes_.cross_correlation_sd = z;
      }
    }
    compare_dwells();
    return codes_;
  }

 private:
  struct Dwell {
    std::size_t segment;
    double variance;
    double n;
  };

  // A sample against the one before, and against one so far back that a filter has forgotten it.
  void count_repeats(const RestPiece& piece, std::size_t at) {
    constexpr std::size_t kFar = 7;
    if (at >= piece.first + kFar && clean_.usable(at - kFar) && clean_.usable(at - 1)) {
      pairs_ += 1;
      repeats_ += clean_.samples[at] == clean_.samples[at - 1] ? 1 : 0;
      repeats_far_ += clean_.samples[at] == clean_.samples[at - kFar] ? 1 : 0;
    }
  }

  void add_deviations(const gt3x::Counts& x, const std::array<double, 3>& mean,
                      const std::array<double, 3>& sd) {
    std::array<double, 3> z{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      by_code_[axis][x[axis]].seen += 1;
      z[axis] = (x[axis] - mean[axis]) / sd[axis];
      // Six sd, and at least three quarters of an LSB beyond, so that the grid itself is none.
      if (std::abs(z[axis]) > 6 + 0.75 / sd[axis]) {
        ++codes_.outliers;
      }
      if (sd[axis] * sd[axis] - 1.0 / 12 > kFreeOfGrid_lsb2) {
        fourth_ += std::pow(z[axis], 4) - 3;
        fourth_n_ += 1;
      }
    }
    cross_[0] += z[1] * z[2];
    cross_[1] += z[0] * z[2];
    cross_[2] += z[0] * z[1];
  }

  void find_odd_code(std::size_t axis) {
    constexpr double kForm = 0.04;  // noise is Gaussian within some per cent of a code's share
    constexpr double kLeast = 20;   // expected, so that the count is nearly Gaussian
    for (const auto& [code, count] : by_code_[axis]) {
      const double z = (count.seen - count.expected) /
                       std::sqrt(count.variance + std::pow(kForm * count.expected, 2));
      if (count.expected > kLeast && std::abs(z) > std::abs(codes_.code_sd)) {
        codes_.code_sd = z;
        codes_.code_axis = axis;
        codes_.code = code;
      }
    }
  }

  // Equal variance in every dwell of an axis: sum of squared relative deviations.
  void compare_dwells() {
    double chi = 0;
    double worst = 0;
    for (const std::vector<Dwell>& dwells : dwells_) {
      std::vector<double> all;
      all.reserve(dwells.size());
      for (const Dwell& d : dwells) {
        all.push_back(d.variance);
      }
      const double typical = upper_median(all);
      // A variance over n white samples scatters by sqrt(2/n). Rounding adds, besides its twelfth,
      // up to so much with the cosine of where between two counts the mean lies.
      const double before_rounding = std::max(0.0, typical - 1.0 / 12);
      const double grid = (4 * before_rounding + 1 / (M_PI * M_PI)) *
                          std::exp(-2 * M_PI * M_PI * before_rounding) / typical;
      for (const Dwell& d : dwells) {
        const double z = (d.variance / typical - 1) / std::sqrt(2 / d.n + grid * grid);
        chi += z * z;
        codes_.spread_freedom += 1;
        if (std::abs(z) > worst) {
          worst = std::abs(z);
          codes_.worst_segment = d.segment;
        }
      }
    }
    codes_.spread_sd =
        (chi - codes_.spread_freedom) / std::sqrt(2 * std::max(1.0, codes_.spread_freedom));
  }

  const CleanSamples& clean_;
  CodeStatistics codes_;
  std::array<double, 3> odd_{}, parity_variance_{}, parity_grid_{}, cross_{};
  double pairs_ = 0, repeats_ = 0, repeats_far_ = 0;
  double fourth_ = 0, fourth_n_ = 0;
  std::array<std::vector<Dwell>, 3> dwells_;
  std::array<std::map<int, CodeCount>, 3> by_code_;
};

}  // namespace

CodeStatistics code_statistics(const Bundle& bundle, const CleanSamples& clean) {
  CodeSums sums(clean);
  for (const RestPiece& piece : pieces_of(bundle)) {
    sums.add(piece);
  }
  return sums.finish();
}

}  // namespace sixpoint::gap
