#include "gap/features/noise.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <unsupported/Eigen/FFT>

namespace sixpoint::gap {
namespace {

constexpr std::size_t kMaxBlocks = 1200;  // beyond it precision is not what is missing
constexpr std::uint8_t kUnusable = kSampleZero | kSampleHeld | kSampleClipped;

bool lies_still(const Segment& segment) { return segment.kind != Segment::Kind::vibration; }

// The settling of a pose change is over after three seconds.
std::size_t quiet_start(const Segment& segment, double rate_hz) {
  return segment.may_ring() ? std::min(segment.samples, static_cast<std::size_t>(3 * rate_hz)) : 0;
}

}  // namespace

double NoiseSpectrum::variance_at(std::size_t axis, double at_hz) const {
  if (frequency_hz.empty()) {
    return 0;
  }
  const auto middle =
      static_cast<std::ptrdiff_t>(std::lround((at_hz - frequency_hz.front()) / step_hz));
  const auto last = static_cast<std::ptrdiff_t>(frequency_hz.size()) - 1;
  std::vector<double> near;
  for (std::ptrdiff_t k = middle - 4; k <= middle + 4; ++k) {
    near.push_back(
        variance_mg2[axis][static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last))]);
  }
  std::nth_element(near.begin(), near.begin() + 4, near.end());
  return near[4];
}

NoiseSpectrum noise_spectrum(const Bundle& bundle, const CleanSamples& clean) {
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
  std::vector<std::size_t> starts;
  for (const Segment& segment : bundle.segments) {
    if (!lies_still(segment)) {
      continue;
    }
    for (std::size_t i = quiet_start(segment, bundle.rate_hz); i + length <= segment.samples;
         i += length) {
      const std::size_t first = segment.first_sample + i;
      const bool clean_block =
          std::none_of(clean.flags.begin() + static_cast<std::ptrdiff_t>(first),
                       clean.flags.begin() + static_cast<std::ptrdiff_t>(first + length),
                       [](std::uint8_t f) { return (f & kUnusable) != 0; });
      if (clean_block) {
        starts.push_back(first);
      }
    }
  }
  const std::size_t stride =
      std::max<std::size_t>(1, (starts.size() + kMaxBlocks - 1) / kMaxBlocks);
  const std::size_t low = 3;
  const std::size_t high = length / 2;
  for (auto& v : spectrum.variance_mg2) {
    v.assign(high - low, 0);
  }
  Eigen::FFT<double> fft;
  std::vector<double> x(length);
  std::vector<std::complex<double>> out;
  for (std::size_t b = 0; b < starts.size(); b += stride) {
    ++spectrum.blocks;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double mean = 0;
      for (std::size_t i = 0; i < length; ++i) {
        x[i] = 1000.0 * clean.samples[starts[b] + i][axis] / bundle.accel_scale_lsb_per_g;
        mean += x[i];
      }
      mean /= static_cast<double>(length);
      for (std::size_t i = 0; i < length; ++i) {
        x[i] = (x[i] - mean) * window[i];
      }
      fft.fwd(out, x);
      for (std::size_t k = low; k < high; ++k) {
        spectrum.variance_mg2[axis][k - low] += std::norm(out[k]) / power;
      }
    }
  }
  for (std::size_t k = low; k < high; ++k) {
    spectrum.frequency_hz.push_back(static_cast<double>(k) * spectrum.step_hz);
  }
  for (std::size_t axis = 0; axis < 3 && spectrum.blocks > 0; ++axis) {
    for (double& v : spectrum.variance_mg2[axis]) {
      v /= static_cast<double>(spectrum.blocks);
    }
    std::vector<double> lowest;
    for (std::size_t k = 0; k < spectrum.frequency_hz.size(); ++k) {
      if (spectrum.frequency_hz[k] < std::max(8.0, 0.08 * bundle.rate_hz)) {
        lowest.push_back(spectrum.variance_mg2[axis][k]);
      }
    }
    if (!lowest.empty()) {
      const auto middle = lowest.begin() + static_cast<std::ptrdiff_t>(lowest.size() / 2);
      std::nth_element(lowest.begin(), middle, lowest.end());
      spectrum.white_mg[axis] = std::sqrt(*middle);
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

}  // namespace

CodeStatistics code_statistics(const Bundle& bundle, const CleanSamples& clean) {
  CodeStatistics codes;
  std::array<double, 3> odd{};
  std::array<double, 3> parity_variance{};
  std::array<double, 3> parity_grid{};
  double repeats = 0;
  double repeats_far = 0;
  double pairs = 0;
  double fourth = 0;
  double fourth_n = 0;
  std::array<double, 3> cross{};
  double cross_n = 0;
  struct Dwell {
    std::size_t segment;
    std::size_t axis;
    double variance;
    double n;
  };
  std::vector<Dwell> dwells;
  std::array<std::map<int, CodeCount>, 3> by_code;
  std::size_t n_all = 0;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const Segment& segment = bundle.segments[s];
    if (!lies_still(segment)) {
      continue;
    }
    const std::size_t from = quiet_start(segment, bundle.rate_hz);
    const auto piece = static_cast<std::size_t>((segment.settled ? 5 : 7) * bundle.rate_hz);
    // Long records in pieces, so that slow wander does not pass for noise; every fourth is enough.
    const std::size_t hop = segment.samples > 4 * piece ? 4 * piece : piece;
    for (std::size_t first = from; first + piece <= segment.samples; first += hop) {
      std::array<double, 3> sum{};
      std::array<double, 3> sum2{};
      double n = 0;
      std::array<double, 3> odd_here{};
      for (std::size_t i = first; i < first + piece; ++i) {
        const std::size_t at = segment.first_sample + i;
        if ((clean.flags[at] & kUnusable) != 0) {
          continue;
        }
        n += 1;
        const gt3x::Counts& x = clean.samples[at];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          sum[axis] += x[axis];
          sum2[axis] += static_cast<double>(x[axis]) * x[axis];
          odd_here[axis] += (x[axis] & 1) != 0 ? 1 : 0;
        }
        if (i >= first + 7 && (clean.flags[at - 7] & kUnusable) == 0 &&
            (clean.flags[at - 1] & kUnusable) == 0) {
          pairs += 1;
          repeats += x == clean.samples[at - 1] ? 1 : 0;
          repeats_far += x == clean.samples[at - 7] ? 1 : 0;
        }
      }
      if (n < 100) {
        continue;
      }
      n_all += static_cast<std::size_t>(n);
      std::array<double, 3> mean{};
      std::array<double, 3> sd{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        mean[axis] = sum[axis] / n;
        const double variance = std::max(1e-12, sum2[axis] / n - mean[axis] * mean[axis]);
        sd[axis] = std::sqrt(variance);
        dwells.push_back({s, axis, variance, n});
        odd[axis] += odd_here[axis] - n / 2;
        // By the sampling of Gaussian noise on the grid of integers the odd share is off by at most
        // exp(-pi^2 variance / 2), with the sign of where the mean lies.
        const double grid = std::exp(-M_PI * M_PI * variance / 2) * n * 2 / M_PI;
        parity_variance[axis] += n / 4;
        parity_grid[axis] += grid;  // of one sign in the worst case
        expect_codes(mean[axis], variance, n, by_code[axis]);
      }
      for (std::size_t i = first; i < first + piece; ++i) {
        const std::size_t at = segment.first_sample + i;
        if ((clean.flags[at] & kUnusable) != 0) {
          continue;
        }
        std::array<double, 3> z{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          by_code[axis][clean.samples[at][axis]].seen += 1;
          z[axis] = (clean.samples[at][axis] - mean[axis]) / sd[axis];
          // Six sd, and at least three quarters of an LSB beyond, so that the grid itself is none.
          if (std::abs(z[axis]) > 6 + 0.75 / sd[axis]) {
            ++codes.outliers;
          }
          fourth += std::pow(z[axis], 4) - 3;
          fourth_n += 1;
        }
        cross[0] += z[1] * z[2];
        cross[1] += z[0] * z[2];
        cross[2] += z[0] * z[1];
        cross_n += 1;
      }
    }
  }
  codes.samples = n_all;
  if (n_all == 0) {
    return codes;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const auto& [code, count] : by_code[axis]) {
      // Noise is Gaussian within some per cent of a code's share.
      constexpr double kForm = 0.04;
      const double z = (count.seen - count.expected) /
                       std::sqrt(count.variance + std::pow(kForm * count.expected, 2));
      if (count.expected > 20 && std::abs(z) > std::abs(codes.code_sd)) {
        codes.code_sd = z;
        codes.code_axis = axis;
        codes.code = code;
      }
    }
  }
  codes.outliers_expected = 3 * static_cast<double>(n_all) * 2e-9;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    codes.odd_share[axis] = 0.5 + odd[axis] / static_cast<double>(n_all);
    codes.parity_sd[axis] =
        (std::sqrt(parity_variance[axis]) + parity_grid[axis] / 2) / static_cast<double>(n_all);
  }
  if (pairs > 0) {
    codes.repeats = repeats / pairs;
    codes.repeats_far = repeats_far / pairs;
    codes.repeats_excess_sd = (repeats - repeats_far) / std::sqrt(repeats + repeats_far + 1);
  }
  codes.kurtosis_sd = fourth / fourth_n / std::sqrt(24 / fourth_n);
  for (const double c : cross) {
    const double z = c / std::sqrt(cross_n);
    if (std::abs(z) > std::abs(codes.cross_correlation_sd)) {
      codes.cross_correlation_sd = z;
    }
  }
  // Equal variance in every dwell of an axis: sum of squared relative deviations.
  double chi = 0;
  double freedom = 0;
  double worst = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> all;
    for (const Dwell& d : dwells) {
      if (d.axis == axis) {
        all.push_back(d.variance);
      }
    }
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    const double typical = *middle;
    for (const Dwell& d : dwells) {
      if (d.axis == axis) {
        // A variance over n white samples scatters by sqrt(2/n); rounding adds a grid's part of it.
        const double grid = 4 * M_PI * M_PI * std::exp(-2 * M_PI * M_PI * typical) / 12;
        const double sd = std::sqrt(2 / d.n + grid * grid);
        const double z = (d.variance / typical - 1) / sd;
        chi += z * z;
        freedom += 1;
        if (std::abs(z) > worst) {
          worst = std::abs(z);
          codes.worst_segment = d.segment;
          codes.worst_ratio = d.variance / typical;
        }
      }
    }
  }
  codes.spread_freedom = freedom;
  codes.spread_sd = (chi - freedom) / std::sqrt(2 * std::max(1.0, freedom));
  return codes;
}

}  // namespace sixpoint::gap
