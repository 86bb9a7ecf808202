#include "gap/features/texture.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "gap/features/noise.h"
#include "gap/recording/at_rest.h"

namespace sixpoint::gap {
namespace {

constexpr std::array<std::size_t, 7> kStretches = {1, 2, 4, 8, 16, 32, 64};
constexpr std::size_t kMoment = 128;  // samples
constexpr std::size_t kLags = 4;

// One axis of one dwell (or ten seconds of a long record) at one scale.
struct Piece {
  std::size_t axis = 0;
  double n = 0;
  double square = 0;
};

struct Moment {
  std::size_t segment = 0;
  std::size_t start = 0;  // its first sample
  std::array<double, 3> n{};
  std::array<double, 3> square{};
};

struct TextureSums {
  std::array<double, 3> n{}, square{}, fourth{};
  std::array<std::array<double, kLags>, 3> lagged{};
  std::vector<Piece> pieces;
  std::vector<Moment> moments;

  double variance(std::size_t axis) const { return n[axis] > 0 ? square[axis] / n[axis] : 0; }
  bool free_of_grid(std::size_t axis, double least_lsb2 = kFreeOfGrid_lsb2) const {
    return n[axis] > 200 && variance(axis) - 1.0 / 12 > least_lsb2;
  }
  double correlation(std::size_t axis, std::size_t lag) const {
    return square[axis] > 0 ? lagged[axis][lag] / square[axis] : 0;
  }
  // How many correlated values count for one in a sum of squares.
  double bunch(std::size_t axis, int power = 2) const {
    double sum = 1;
    for (std::size_t lag = 0; lag < kLags; ++lag) {
      sum += 2 * std::pow(correlation(axis, lag), power);
    }
    return sum;
  }
};

// Normal deviate of a chi-square (Wilson and Hilferty).
double normal_of(double chi, double freedom) {
  const double s = 2 / (9 * freedom);
  return (std::cbrt(chi / freedom) - (1 - s)) / std::sqrt(s);
}

// One dwell, or ten seconds of a long record, in LSB.
struct Run {
  RestPiece piece;
  std::array<std::vector<double>, 3> counts;
  std::vector<bool> usable;
};

// Takes lines off by least squares: sine and cosine of each, and a mean that stays.
void take_lines_off(const std::vector<double>& lines_hz, double rate_hz, Run& run) {
  const auto n = static_cast<Eigen::Index>(run.piece.samples);
  const Eigen::Index lines = std::ssize(lines_hz);
  Eigen::MatrixXd columns(n, 2 * lines + 1);
  columns.col(2 * lines).setOnes();
  for (Eigen::Index k = 0; k < lines; ++k) {
    const double w = 2 * M_PI * lines_hz[static_cast<std::size_t>(k)] / rate_hz;
    const Eigen::ArrayXd angle = w * Eigen::ArrayXd::LinSpaced(n, 0, static_cast<double>(n - 1));
    columns.col(2 * k) = angle.sin();
    columns.col(2 * k + 1) = angle.cos();
  }
  Eigen::MatrixXd known = columns;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!run.usable[static_cast<std::size_t>(i)]) {
      known.row(i).setZero();
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> normal(known.transpose() * known);
  for (std::vector<double>& counts : run.counts) {
    Eigen::Map<Eigen::VectorXd> values(counts.data(), n);
    const Eigen::VectorXd fit = normal.solve(known.transpose() * values);
    values -= columns.leftCols(2 * lines) * fit.head(2 * lines);
  }
}

// Nothing where lines have to be taken off and a slip in the run breaks their phase.
std::optional<Run> run_of(const Bundle& bundle, const CleanSamples& clean, const RestPiece& piece,
                          const std::vector<double>& lines_hz) {
  Run run{piece, {}, std::vector<bool>(piece.samples)};
  std::size_t usable = 0;
  for (std::size_t i = 0; i < piece.samples; ++i) {
    const std::size_t at = piece.first + i;
    run.usable[i] = clean.usable(at);
    usable += run.usable[i] ? 1 : 0;
    if (!lines_hz.empty() && run.usable[i] && !clean.in_step(at)) {
      return std::nullopt;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      run.counts[axis].push_back(clean.samples[at][axis]);
    }
  }
  // Sines that fit noise take little of it only where there are many samples for each.
  constexpr std::size_t kSamplesPerLine = 50;
  if (usable < kSamplesPerLine * lines_hz.size()) {
    return std::nullopt;
  }
  if (!lines_hz.empty()) {
    take_lines_off(lines_hz, bundle.rate_hz, run);
  }
  return run;
}

// Sum of the second stretch less that of the first, per axis; nothing where a sample is masked.
std::optional<std::array<double, 3>> difference_at(const Run& run, std::size_t at,
                                                   std::size_t stretch) {
  std::array<double, 3> difference{};
  for (std::size_t k = 0; k < 2 * stretch; ++k) {
    if (!run.usable[at + k]) {
      return std::nullopt;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      difference[axis] += k < stretch ? -run.counts[axis][at + k] : run.counts[axis][at + k];
    }
  }
  return difference;
}

void add_run(const Run& run, std::size_t stretch, TextureSums& sums) {
  constexpr double kFewest = 4;  // differences of a piece
  const double scale = std::sqrt(static_cast<double>(stretch) / 2);
  std::array<Piece, 3> pieces;
  std::array<std::array<double, kLags>, 3> before{};
  std::size_t known = 0;  // of `before`
  std::size_t moment = static_cast<std::size_t>(-1);
  for (std::size_t i = 0; i + 2 * stretch <= run.piece.samples; i += 2 * stretch) {
    const auto difference = difference_at(run, i, stretch);
    if (!difference) {
      known = 0;
      continue;
    }
    if (i / kMoment != moment) {
      moment = i / kMoment;
      sums.moments.push_back({run.piece.segment, run.piece.first + moment * kMoment, {}, {}});
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double d = (*difference)[axis] * scale / static_cast<double>(stretch);
      const double square = d * d;
      sums.n[axis] += 1;
      sums.square[axis] += square;
      sums.fourth[axis] += square * square;
      pieces[axis].n += 1;
      pieces[axis].square += square;
      sums.moments.back().n[axis] += 1;
      sums.moments.back().square[axis] += square;
      for (std::size_t lag = 0; lag < std::min(known, kLags); ++lag) {
        sums.lagged[axis][lag] += d * before[axis][lag];
      }
      std::shift_right(before[axis].begin(), before[axis].end(), 1);
      before[axis][0] = d;
    }
    ++known;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    pieces[axis].axis = axis;
    if (pieces[axis].n >= kFewest) {
      sums.pieces.push_back(pieces[axis]);
    }
  }
}

// The first seconds after a move, in which no dwell of rest_pieces() begins.
std::optional<RestPiece> piece_after_move(const Bundle& bundle, std::size_t segment,
                                          double quiet_s) {
  const Segment& from = bundle.segments[segment];
  const std::size_t end = from.quiet_start(bundle.rate_hz);
  const auto begin = static_cast<std::size_t>(quiet_s * bundle.rate_hz);
  if (!from.at_rest() || begin >= end || end == from.samples) {
    return std::nullopt;
  }
  return RestPiece{segment, from.first_sample + begin, end - begin};
}

// One for each of kStretches.
std::vector<TextureSums> sums_after_moves(const Bundle& bundle, const CleanSamples& clean,
                                          const std::vector<double>& lines_hz,
                                          const std::function<double(double)>& ringing,
                                          double quiet_s) {
  std::vector<TextureSums> all(kStretches.size());
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const auto piece = piece_after_move(bundle, s, quiet_s);
    auto run = piece ? run_of(bundle, clean, *piece, lines_hz) : std::nullopt;
    if (!run) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3 && ringing; ++axis) {
      const double step_lsb = clean.accel_scale_lsb_per_g *
                              bundle.segments[s].approach_g[static_cast<Eigen::Index>(axis)];
      for (std::size_t i = 0; i < piece->samples; ++i) {
        const double t_s = quiet_s + static_cast<double>(i) / bundle.rate_hz;
        run->counts[axis][i] -= step_lsb * ringing(t_s);
      }
    }
    for (std::size_t k = 0; k < kStretches.size(); ++k) {
      add_run(*run, kStretches[k], all[k]);
    }
  }
  return all;
}

// The variance after moves against that of the rest, whose own error counts, too.
double after_moves(const TextureSums& early, const TextureSums& rest) {
  double chi = 0, freedom = 0, known = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (rest.free_of_grid(axis) && early.n[axis] > 0) {
      const double bunch = rest.bunch(axis);
      chi += early.square[axis] / (rest.variance(axis) * bunch);
      freedom += early.n[axis] / bunch;
      known += rest.n[axis] / bunch;
    }
  }
  const double both = freedom > 0 ? 1 / (1 / freedom + 1 / known) : 0;
  return freedom > 0 ? normal_of(chi / freedom * both, both) : 0;
}

// One for each of kStretches.
std::vector<TextureSums> sums_of(const Bundle& bundle, const CleanSamples& clean,
                                 const std::vector<double>& lines_hz) {
  const std::size_t most = 10 * static_cast<std::size_t>(bundle.rate_hz);
  std::vector<TextureSums> all(kStretches.size());
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    for (const RestPiece& piece : rest_pieces(bundle, s, most)) {
      if (const auto run = run_of(bundle, clean, piece, lines_hz)) {
        for (std::size_t k = 0; k < kStretches.size(); ++k) {
          add_run(*run, kStretches[k], all[k]);
        }
      }
    }
  }
  return all;
}

// `finest`: the sums of one sample. Where a filter leaves hardly any difference between neighbours
// they are rounded alike, and the errors of a stretch add up: the form shows it below twice the
// variance (order 4 at an eighth of the rate leaves 0.02 of 1 LSB^2 at one sample, and an excess of
// -0.08 at four, whose variance is 0.8).
void tails(const TextureSums& sums, const TextureSums& finest, Texture::Scale& found) {
  constexpr double kHardly_lsb2 = 0.05;
  double up = 0;
  double down = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const bool rounded_alike = finest.variance(axis) - 1.0 / 12 < kHardly_lsb2;
    if (sums.free_of_grid(axis, kFreeOfGrid_lsb2 * (rounded_alike ? 2 : 1))) {
      const double n = sums.n[axis];
      const double variance = sums.variance(axis);
      const double excess = sums.fourth[axis] / n / (variance * variance) - 3 + 6 / n;
      const double weight = n / (24 * sums.bunch(axis, 4));
      up += excess * weight;
      down += weight;
    }
  }
  found.sd_per_excess = std::sqrt(down);
  found.tails_sd = down > 0 ? up / found.sd_per_excess : 0;
}

// Bartlett's test of equal variances.
double dwells(const std::vector<const TextureSums*>& scales) {
  double statistic = 0;
  double freedom = 0;
  for (const TextureSums* sums : scales) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!sums->free_of_grid(axis)) {
        continue;
      }
      const double bunch = sums->bunch(axis);
      double all = 0, square = 0, logs = 0, inverse = 0, count = 0;
      for (const Piece& piece : sums->pieces) {
        if (piece.axis == axis && piece.square > 0) {
          const double n = piece.n / bunch;
          all += n;
          square += piece.square / bunch;
          logs += n * std::log(piece.square / piece.n);
          inverse += 1 / n;
          count += 1;
        }
      }
      if (count > 2) {
        const double m = all * std::log(square / all) - logs;
        statistic += m / (1 + (inverse - 1 / all) / (3 * (count - 1)));
        freedom += count - 1;
      }
    }
  }
  return freedom > 0 ? normal_of(std::max(0.0, statistic), freedom) : 0;
}

void moments(const std::vector<const TextureSums*>& scales, Texture::Scale& found) {
  struct Energy {
    std::size_t segment = 0;
    double chi = 0;
    double freedom = 0;
  };
  std::map<std::size_t, Energy> energies;
  for (const TextureSums* sums : scales) {
    std::array<double, 3> per{};
    std::array<double, 3> bunch{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bunch[axis] = sums->bunch(axis);
      per[axis] = sums->free_of_grid(axis) ? 1 / (sums->variance(axis) * bunch[axis]) : 0;
    }
    for (const Moment& moment : sums->moments) {
      Energy& energy = energies[moment.start];
      energy.segment = moment.segment;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (per[axis] > 0) {
          energy.chi += moment.square[axis] * per[axis];
          energy.freedom += moment.n[axis] / bunch[axis];
        }
      }
    }
  }
  double square = 0;
  double count = 0;
  double loudest = -1e9;
  for (const auto& [start, energy] : energies) {
    if (energy.freedom < 6) {
      continue;
    }
    const double z = normal_of(energy.chi, energy.freedom);
    square += z * z;
    count += 1;
    if (z > loudest) {
      loudest = z;
      found.loudest_segment = energy.segment;
    }
  }
  if (count > 10) {
    found.moments_sd = normal_of(square, count);
    // The largest of n is beyond z as often as one is beyond the root of z^2 - 2 ln n.
    found.loudest_sd =
        loudest > 0 ? std::sqrt(std::max(0.0, loudest * loudest - 2 * std::log(count))) : 0;
  }
}

}  // namespace

Texture noise_texture(const Bundle& bundle, const CleanSamples& clean,
                      const std::vector<double>& lines_hz,
                      const std::function<double(double t_s)>& ringing, double quiet_s) {
  Texture texture;
  if (bundle.rate_hz < 10) {
    return texture;
  }
  const std::vector<TextureSums> all = sums_of(bundle, clean, lines_hz);
  const std::vector<TextureSums> early =
      sums_after_moves(bundle, clean, lines_hz, ringing, quiet_s);
  std::vector<const TextureSums*> fine;
  texture.scales.reserve(all.size() + 1);
  for (std::size_t i = 0; i < all.size(); ++i) {
    Texture::Scale scale;
    scale.samples = kStretches[i];
    tails(all[i], all.front(), scale);
    scale.dwells_sd = dwells({&all[i]});
    moments({&all[i]}, scale);
    scale.after_moves_sd = after_moves(early[i], all[i]);
    texture.scales.push_back(scale);
    if (kStretches[i] <= 8) {
      fine.push_back(&all[i]);
    }
  }
  Texture::Scale together;
  together.dwells_sd = dwells(fine);
  moments(fine, together);
  texture.scales.push_back(together);
  return texture;
}

}  // namespace sixpoint::gap
