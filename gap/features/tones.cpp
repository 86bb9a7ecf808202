#include "gap/features/tones.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace sixpoint::gap {
namespace {

constexpr std::size_t kShortestPiece = 10;  // three unknowns and some to test them
constexpr std::size_t kSlipGuard = 12;      // that piece and the uncertainty of a cut
// In squared residuals over their variance. Of white residuals the best cut gains about 25.
constexpr double kCut = 60;
constexpr double kPiece = 8;  // a cut and three unknowns
// A row of steps has to be better than an even drift by this: the best of hundreds of places for a
// cut gains about 25 by chance, and a true slip, hundreds.
constexpr double kClearlySteps = 24;

// ToneSums over samples up to an index: enough to fit 1, cos, sin on any stretch.
struct ToneSums {
  double n = 0, c = 0, s = 0, cc = 0, cs = 0, ss = 0, y = 0, yc = 0, ys = 0, yy = 0;
  void add(double value, double angle) {
    const double cosine = std::cos(angle);
    const double sine = std::sin(angle);
    n += 1;
    c += cosine;
    s += sine;
    cc += cosine * cosine;
    cs += cosine * sine;
    ss += sine * sine;
    y += value;
    yc += value * cosine;
    ys += value * sine;
    yy += value * value;
  }
  ToneSums operator-(const ToneSums& o) const {
    return {n - o.n,   c - o.c, s - o.s,   cc - o.cc, cs - o.cs,
            ss - o.ss, y - o.y, yc - o.yc, ys - o.ys, yy - o.yy};
  }
};

struct PieceFit {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();  // level, cos, sin
  double squares = 0;
  double n = 0;
  double phase() const { return std::atan2(-x[2], x[1]); }  // of a cos(wt + phase)
  double amplitude() const { return std::hypot(x[1], x[2]); }
};

Eigen::Matrix3d normal_matrix(const ToneSums& d) {
  Eigen::Matrix3d a;
  a << d.n, d.c, d.s, d.c, d.cc, d.cs, d.s, d.cs, d.ss;
  return a;
}

// Level, cosine and sine can be told apart. Where a tone of a fifth of the rate is clipped, one or
// two of its five phases are left, and any amplitude fits them.
bool determines(const ToneSums& d) {
  constexpr double kLeast = 1e-3;  // with all phases the smallest eigenvalue is a half
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(normal_matrix(d) / d.n,
                                                              Eigen::EigenvaluesOnly);
  return solver.eigenvalues()[0] > kLeast;
}

PieceFit fit_piece(const ToneSums& d) {
  PieceFit fit;
  fit.n = d.n;
  if (d.n < 5) {
    fit.squares = d.yy;
    return fit;
  }
  Eigen::Matrix3d a = normal_matrix(d);
  a.diagonal().array() += 1e-9 * d.n;
  const Eigen::Vector3d b(d.y, d.yc, d.ys);
  fit.x = a.inverse() * b;
  fit.squares = std::max(0.0, d.yy - b.dot(fit.x));
  return fit;
}

std::vector<ToneSums> prefix_sums(const std::vector<double>& y,
                                  const std::vector<std::uint8_t>& good, double w) {
  std::vector<ToneSums> sums(y.size() + 1);
  for (std::size_t i = 0; i < y.size(); ++i) {
    sums[i + 1] = sums[i];
    if (good[i] != 0) {
      sums[i + 1].add(y[i], w * static_cast<double>(i));
    }
  }
  return sums;
}

double circle(double angle) { return std::remainder(angle, 2 * M_PI); }

class ToneAnalysis {
 public:
  ToneAnalysis(const Bundle& bundle, const CleanSamples& clean, std::size_t index,
               const ToneOptions& options)
      : bundle_(bundle), clean_(clean), segment_(bundle.segments[index]), options_(options) {
    fit_.segment = index;
    const Eigen::Vector3d along = segment_.rotation * segment_.vibration->direction_lab;
    along.cwiseAbs().maxCoeff(&fit_.axis);
    noise2_ = std::pow(options.noise_mg[static_cast<std::size_t>(fit_.axis)], 2);
    for (const SpectralLine& line : options.lines) {
      noise2_ += std::pow(line_in_sensor(line)[fit_.axis], 2) / 2;
    }
    good_.resize(segment_.samples);
    y_.resize(segment_.samples);
    for (std::size_t i = 0; i < segment_.samples; ++i) {
      const std::size_t at = segment_.first_sample + i;
      // What a move or a filter leaves at the start is not of the tone.
      const bool quiet =
          static_cast<double>(i) >= (segment_.starts_placement ? 2 : 0.3) * bundle.rate_hz;
      good_[i] = quiet && clean.usable(at) ? 1 : 0;
      fit_.samples += good_[i];
      y_[i] = clean.value_mg(at, static_cast<std::size_t>(fit_.axis));
      fit_.clipped_share += (clean.flags[at] & kSampleClipped) != 0 ? 1 : 0;
    }
    fit_.clipped_share /= static_cast<double>(segment_.samples);
  }

  ToneFit run() {
    if (fit_.samples < 100) {
      return fit_;
    }
    w_ = 2 * M_PI * segment_.vibration->frequency_hz / bundle_.rate_hz /
         (1 + 1e-6 * options_.clock_ppm);
    // About half of the sample rate sine and cosine look alike, and beyond it nothing of this
    // holds.
    constexpr double kHighest = 0.95 * M_PI;
    if (std::sin(w_) == 0 || w_ >= kHighest) {
      return fit_;
    }
    find_slips();
    fit_all();
    add_lines();
    return fit_;
  }

 private:
  Eigen::Vector3d line_in_sensor(const SpectralLine& line) const {
    return line.in_lab ? Eigen::Vector3d(segment_.rotation * line.vector_mg) : line.vector_mg;
  }

  // What a line shows at another frequency in a record of this length: its size times a sinc.
  void add_lines() {
    const double seconds = static_cast<double>(fit_.samples) / bundle_.rate_hz;
    const auto folded_hz = [&](double f) { return std::abs(std::remainder(f, bundle_.rate_hz)); };
    for (const SpectralLine& line : options_.lines) {
      for (std::size_t k = 0; k < fit_.line_mg2.size(); ++k) {
        const double tone_hz = static_cast<double>(k + 1) * segment_.vibration->frequency_hz;
        const double turns = M_PI * seconds * (folded_hz(line.frequency_hz) - folded_hz(tone_hz));
        const double share = std::abs(turns) < 1e-6 ? 1 : std::sin(turns) / turns;
        fit_.line_mg2[k] += (share * line_in_sensor(line)).cwiseAbs2() / 2;
      }
    }
    // A frequency is known as well as the phase from one half of the record to the other.
    const double white_mg2 = 2 * noise2_ / static_cast<double>(fit_.samples);
    fit_.frequency_sd_ppm *= std::sqrt(1 + fit_.line_mg2[0][fit_.axis] / white_mg2);
  }

  void find_slips() {
    const auto sums = prefix_sums(y_, good_, w_);
    std::vector<std::size_t> cuts = {0, y_.size()};
    split(sums, 0, y_.size(), cuts, 0);
    steps_.assign(y_.size(), 0);
    if (cuts.size() == 2) {
      return;
    }
    // A tone off its frequency drifts evenly; cut into pieces it would look like a row of slips.
    const double cost_cut = cost(sums, cuts);
    const double even = best_even_drift();
    if (even_cost_ < cost_cut + kClearlySteps * noise2_) {
      w_ *= 1 + even;
      return;
    }
    std::sort(cuts.begin(), cuts.end());
    merge(sums, cuts);
    int shift = 0;
    for (std::size_t p = 1; p + 1 < cuts.size(); ++p) {
      const auto slip = slip_between(fit_piece(sums[cuts[p]] - sums[cuts[p - 1]]),
                                     fit_piece(sums[cuts[p + 1]] - sums[cuts[p]]));
      if (slip) {
        fit_.slips.push_back({cuts[p], *slip});
        shift += *slip;
      }
      std::fill(steps_.begin() + static_cast<std::ptrdiff_t>(cuts[p]),
                steps_.begin() + static_cast<std::ptrdiff_t>(cuts[p + 1]), shift);
    }
  }

  // Samples lost between two pieces, 0 for a step that is no whole number of samples; nothing where
  // the level moved, not the phase.
  std::optional<int> slip_between(const PieceFit& before, const PieceFit& after) const {
    constexpr double kClearlyBetter = 0.6;  // the smaller number wins unless clearly worse
    constexpr double kStep_sd = 6;
    constexpr double kWhole = 0.12;  // of a sample
    const double step = circle(after.phase() - before.phase());
    int best = 0;
    double best_miss = std::abs(step);
    for (const int k : {1, -1, 2, -2, 3, -3, 4, -4}) {
      const double miss = std::abs(circle(step - k * w_));
      if (miss < kClearlyBetter * best_miss) {
        best = k;
        best_miss = miss;
      }
    }
    const double sd = std::sqrt(2 * noise2_ * (1 / before.n + 1 / after.n)) /
                      std::max(1e-9, 0.5 * (before.amplitude() + after.amplitude()));
    if (std::abs(step) < kStep_sd * sd) {
      return std::nullopt;
    }
    return best_miss < std::max(kStep_sd * sd, kWhole * std::abs(w_)) ? best : 0;
  }

  // Takes back cuts that gain nothing against the noise that is there (the halves of split(), or
  // scatter that the tone adds).
  void merge(const std::vector<ToneSums>& sums, std::vector<std::size_t>& cuts) const {
    while (cuts.size() > 2) {
      double least = 1e300;
      std::size_t at = 0;
      double pieces_squares = 0;
      for (std::size_t p = 0; p + 1 < cuts.size(); ++p) {
        pieces_squares += fit_piece(sums[cuts[p + 1]] - sums[cuts[p]]).squares;
      }
      const double variance = std::max(
          noise2_,
          pieces_squares / std::max(1.0, sums.back().n - 3 * static_cast<double>(cuts.size() - 1)));
      for (std::size_t p = 1; p + 1 < cuts.size(); ++p) {
        const double apart = fit_piece(sums[cuts[p]] - sums[cuts[p - 1]]).squares +
                             fit_piece(sums[cuts[p + 1]] - sums[cuts[p]]).squares;
        const double gain = fit_piece(sums[cuts[p + 1]] - sums[cuts[p - 1]]).squares - apart;
        if (gain < least) {
          least = gain;
          at = p;
        }
      }
      if (least > kCut * variance) {
        return;
      }
      cuts.erase(cuts.begin() + static_cast<std::ptrdiff_t>(at));
    }
  }

  // What one unbroken tone, off by this share, leaves of the first `count` samples.
  double even_squares(std::size_t count, double e) const {
    const double w = w_ * (1 + e);
    ToneSums sums;
    for (std::size_t i = 0; i < count; ++i) {
      if (good_[i] != 0) {
        sums.add(y_[i], w * static_cast<double>(i));
      }
    }
    return fit_piece(sums).squares;
  }

  // A grid of 2 half + 1 points about `centre`; the best that is better than `least`, which follows.
  double best_on_grid(std::size_t count, double centre, double grid, int half,
                      double& least) const {
    double best = centre;
    for (int k = -half; k <= half; ++k) {
      const double e = centre + k * grid;
      const double squares = even_squares(count, e);
      if (squares < least) {
        least = squares;
        best = e;
      }
    }
    return best;
  }

  // The clock's error relative to the protocol that makes one unbroken tone fit best. The last grid
  // is so fine that what it leaves of a tone of 1 g is below the noise. The first one needs more
  // points the longer the tone is: it is tried on a stretch, and then on eight times as much each.
  double best_even_drift() {
    constexpr std::size_t kStretch = 1U << 14U;  // longer than any tone of the protocols
    constexpr int kFinerBy = 8;
    const double reach = 0.006;  // beyond any clock of the catalogue
    std::size_t count = std::min(y_.size(), kStretch);
    // A quarter turn over what is tried.
    const auto step = [&] { return 0.25 * 2 * M_PI / (static_cast<double>(count) * w_); };
    even_cost_ = even_squares(count, 0);
    auto half = static_cast<int>(std::ceil(reach / step()));
    double best = best_on_grid(count, 0, step(), half, even_cost_);
    while (count < y_.size()) {
      count = std::min(y_.size(), kFinerBy * count);
      even_cost_ = even_squares(count, best);
      best = best_on_grid(count, best, step(), kFinerBy, even_cost_);
    }
    for (int round = 1; round < 6; ++round) {
      best = best_on_grid(count, best, step() / std::pow(kFinerBy, round), kFinerBy, even_cost_);
    }
    return best;
  }

  double cost(const std::vector<ToneSums>& sums, std::vector<std::size_t> cuts) const {
    std::sort(cuts.begin(), cuts.end());
    double total = 0;
    for (std::size_t p = 0; p + 1 < cuts.size(); ++p) {
      total += fit_piece(sums[cuts[p + 1]] - sums[cuts[p]]).squares + kPiece * noise2_;
    }
    return total;
  }

  void split(const std::vector<ToneSums>& sums, std::size_t first, std::size_t last,
             std::vector<std::size_t>& cuts, int depth) const {
    if (last - first < 2 * kShortestPiece || depth > 12) {
      return;
    }
    const double whole = fit_piece(sums[last] - sums[first]).squares;
    if (whole < noise2_ * (static_cast<double>(last - first) + 40)) {
      return;
    }
    double best = whole;
    std::size_t at = first;
    for (std::size_t c = first + kShortestPiece; c + kShortestPiece <= last; ++c) {
      const double squares =
          fit_piece(sums[c] - sums[first]).squares + fit_piece(sums[last] - sums[c]).squares;
      if (squares < best) {
        best = squares;
        at = c;
      }
    }
    const double variance = std::max(noise2_, best / static_cast<double>(last - first));
    if (whole - best < kCut * variance) {
      // Two slips that undo each other within a period hide from a single cut: the halves are
      // tried.
      if (whole > 3 * noise2_ * static_cast<double>(last - first) &&
          last - first > 8 * kShortestPiece) {
        const std::size_t middle = (first + last) / 2;
        cuts.push_back(middle);
        split(sums, first, middle, cuts, depth + 1);
        split(sums, middle, last, cuts, depth + 1);
      }
      return;
    }
    cuts.push_back(at);
    split(sums, first, at, cuts, depth + 1);
    split(sums, at, last, cuts, depth + 1);
  }

  void fit_all() {
    // Phase first, then everything in phase with it.
    double phase0 = 0;
    for (int round = 0; round < 2; ++round) {
      ToneSums total;
      for (std::size_t i = 0; i < y_.size(); ++i) {
        if (good_[i] != 0) {
          total.add(y_[i], angle(i));
        }
      }
      const PieceFit first = fit_piece(total);
      phase0 = first.phase();
      if (round == 0) {
        determined_ = determines(total);  // a frequency fitted to nothing would turn the phases
        refine_frequency(phase0, first.amplitude());
      }
    }
    Eigen::Matrix<double, 5, 5> a = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> b = Eigen::Matrix<double, 5, 1>::Zero();
    Eigen::Matrix3d a_cross = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d b_cross = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < y_.size(); ++i) {
      if (good_[i] == 0) {
        continue;
      }
      const double p = angle(i) + phase0;
      Eigen::Matrix<double, 5, 1> row;
      row << 1, std::cos(p), std::cos(2 * p), std::cos(3 * p), std::sin(p);
      a += row * row.transpose();
      b += row * y_[i];
      const Eigen::Vector3d cross(1, row[1], row[4]);
      a_cross += cross * cross.transpose();
      for (std::size_t k = 0; k < 3; ++k) {
        b_cross.col(static_cast<Eigen::Index>(k)) +=
            cross * clean_.value_mg(segment_.first_sample + i, k);
      }
    }
    // Second and third harmonic fold onto one frequency at a fifth of the rate: a weak prior (50
    // mg) keeps an unlucky phase from making them infinite.
    a(2, 2) += noise2_ / 2500;
    a(3, 3) += noise2_ / 2500;
    const Eigen::Matrix<double, 5, 5> inverse = a.inverse();
    const Eigen::Matrix<double, 5, 1> x = inverse * b;
    const Eigen::Matrix3d cross_inverse = a_cross.inverse();
    const Eigen::Matrix3d x_cross = cross_inverse * b_cross;
    for (Eigen::Index k = 0; k < 3; ++k) {
      fit_.level_mg[k] = x_cross(0, k);
      fit_.in_phase_mg[k] = x_cross(1, k);
      fit_.quadrature_mg[k] = x_cross(2, k);
    }
    fit_.level_mg[fit_.axis] = x[0];
    fit_.in_phase_mg[fit_.axis] = x[1];
    fit_.quadrature_mg[fit_.axis] = 0;
    fit_.second_mg = x[2];
    fit_.third_mg = x[3];
    fit_.covariance_shape = inverse.topLeftCorner<4, 4>();
    fit_.cross_shape = cross_inverse.topLeftCorner<2, 2>();
    measure_residuals(x, phase0);
  }

  // Where a slip lies is known to some samples: between its place and the cut the phase is wrong,
  // which is on the slopes. So it is between two slips that are nearer than a piece is long, and
  // behind one that is so near to an end.
  std::vector<std::uint8_t> samples_beside_slips() const {
    std::vector<std::uint8_t> beside(y_.size(), 0);
    const auto mark = [&](std::size_t at) {
      const std::size_t last = std::min(y_.size(), at + kSlipGuard);
      for (std::size_t i = at - std::min(at, kSlipGuard); i < last; ++i) {
        beside[i] = 1;
      }
    };
    mark(static_cast<std::size_t>(std::ranges::find(good_, 1) - good_.begin()));
    mark(y_.size());
    std::ranges::for_each(fit_.slips, [&](const Slip& slip) { mark(slip.sample); });
    return beside;
  }

  // About level, tone, its harmonics and a phase error: `x`.
  void measure_residuals(const Eigen::Matrix<double, 5, 1>& x, double phase0) {
    double squares = 0;
    double slope = 0;
    double slope_weight = 0;
    double crest = 0;
    double crest_weight = 0;
    const std::vector<std::uint8_t> beside_slip = samples_beside_slips();
    for (std::size_t i = 0; i < y_.size(); ++i) {
      if (good_[i] == 0) {
        continue;
      }
      const double p = angle(i) + phase0;
      const double r = y_[i] - (x[0] + x[1] * std::cos(p) + x[2] * std::cos(2 * p) +
                                x[3] * std::cos(3 * p) + x[4] * std::sin(p));
      const double s2 = std::sin(p) * std::sin(p);
      squares += r * r;
      if (beside_slip[i] != 0) {
        continue;
      }
      ++fit_.samples_apart;
      slope += r * r * s2;
      slope_weight += s2;
      crest += r * r * (1 - s2);
      crest_weight += 1 - s2;
    }
    fit_.residual_mg = std::sqrt(squares / std::max(1.0, static_cast<double>(fit_.samples) - 5));
    fit_.frequency_sd_ppm *= std::max(1.0, fit_.residual_mg / std::sqrt(noise2_));
    fit_.on_slope_mg2 = slope / std::max(1.0, slope_weight);
    fit_.on_crest_mg2 = crest / std::max(1.0, crest_weight);
    fit_.usable = determined_ && fit_.in_phase_mg[fit_.axis] > 0 && std::isfinite(fit_.residual_mg);
  }

  // Gauss-Newton on the frequency: the sine's amplitude grows with n where it is off.
  void refine_frequency(double phase0, double amplitude) {
    if (!(amplitude > 0)) {
      return;
    }
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    const double middle = 0.5 * static_cast<double>(y_.size());
    for (std::size_t i = 0; i < y_.size(); ++i) {
      if (good_[i] == 0) {
        continue;
      }
      const double p = angle(i) + phase0;
      const double n = static_cast<double>(i) - middle;
      const Eigen::Vector4d row(1, std::cos(p), std::sin(p), -amplitude * std::sin(p) * n * w_);
      a += row * row.transpose();
      b += row * y_[i];
    }
    const Eigen::Matrix4d inverse = a.inverse();
    const Eigen::Vector4d x = inverse * b;
    const double e = x[3];  // relative change of frequency
    const double nominal = 2 * M_PI * segment_.vibration->frequency_hz / bundle_.rate_hz;
    fit_.frequency_sd_ppm = 1e6 * std::sqrt(noise2_ * inverse(3, 3));
    if (std::isfinite(e) && std::abs(e) < 0.01) {
      w_ *= 1 + e;
    }
    fit_.frequency_ppm = 1e6 * (w_ / nominal - 1);
  }

  double angle(std::size_t i) const { return w_ * (static_cast<double>(i) + steps_[i]); }

  const Bundle& bundle_;
  const CleanSamples& clean_;
  const Segment& segment_;
  ToneOptions options_;
  ToneFit fit_;
  std::vector<double> y_;
  std::vector<std::uint8_t> good_;
  std::vector<int> steps_;
  double noise2_ = 16;
  double w_ = 0;
  double even_cost_ = 0;
  bool determined_ = false;
};

}  // namespace

std::vector<ToneFit> fit_tones(const Bundle& bundle, const CleanSamples& clean,
                               const ToneOptions& options) {
  std::vector<ToneFit> fits;
  for (std::size_t i = 0; i < bundle.segments.size(); ++i) {
    if (bundle.segments[i].vibration) {
      fits.push_back(ToneAnalysis(bundle, clean, i, options).run());
    }
  }
  return fits;
}

}  // namespace sixpoint::gap
