#include "gap/features/lines.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "gap/features/line_scan.h"

namespace sixpoint::gap {
namespace {

using Complex = std::complex<double>;
using Vector3c = Eigen::Vector3cd;

constexpr double kLowest_hz = 3;  // below it is slow noise; vibration of floors is faster
// Chance of one false line in a whole recording. One false alarm in a hundred recordings is what
// the whole diagnosis is allowed; some ten kinds of decision share it evenly.
constexpr double kFalseLines = 1e-3;
constexpr double kDwell_s = 30;  // longer ones are records of their own

Vector3c amplitude_at(const Stretch& stretch, double w) {
  Vector3c sum = Vector3c::Zero();
  const Complex turn = std::polar(1.0, -w);
  Complex phase = 1;
  for (std::size_t i = 0; i < stretch.samples; ++i) {
    sum[0] += phase * stretch.x[0][i];
    sum[1] += phase * stretch.x[1][i];
    sum[2] += phase * stretch.x[2][i];
    phase *= turn;
    if ((i & 1023U) == 1023U) {
      phase /= std::abs(phase);
    }
  }
  return sum * (2.0 / static_cast<double>(stretch.known));
}

// Least squares, twice: what is masked makes sine and cosine depend on each other a little.
void take_off(Stretch& stretch, double w) {
  for (int round = 0; round < 2; ++round) {
    const Vector3c amplitude = amplitude_at(stretch, w);
    const Complex turn = std::polar(1.0, w);
    Complex phase = 1;
    for (std::size_t i = 0; i < stretch.samples; ++i) {
      for (std::size_t axis = 0; axis < 3 && stretch.is_known[i]; ++axis) {
        stretch.x[axis][i] -= (amplitude[static_cast<Eigen::Index>(axis)] * phase).real();
      }
      phase *= turn;
      if ((i & 1023U) == 1023U) {
        phase /= std::abs(phase);
      }
    }
  }
}

// 1 / variance of the real part of a stretch's amplitude, per axis.
Eigen::Vector3d weights_at(const Stretch& stretch, const NoiseSpectrum& noise,
                           double frequency_hz) {
  return static_cast<double>(stretch.known) / (2 * noise.variances_at(frequency_hz).array());
}

// One dwell's complex amplitude, its weights and its pose.
struct Phasor {
  Vector3c amplitude;
  Eigen::Vector3d weight;  // 1 / variance of the real part
  Eigen::Matrix3d rotation;
  int pose = 0;
  double start_s = 0;  // by the host's clock; the amplitude's phase is that of this moment
  double seconds = 0;
};

// Turns a vector of the frame in question into the frame of a dwell, a Phasor or a Stretch.
template <class Dwell>
Eigen::Matrix3d to_sensor(const Dwell& dwell, bool in_lab) {
  return in_lab ? dwell.rotation : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

// A predicted amplitude against a dwell's, weighted.
struct Overlap {
  Complex overlap = 0;
  double square = 0;  // of the prediction
  double power = 0;   // of the dwell
};

Overlap overlap_of(const Vector3c& predicted, const Phasor& p) {
  Overlap sums;
  for (Eigen::Index k = 0; k < 3; ++k) {
    sums.overlap += std::conj(predicted[k]) * p.weight[k] * p.amplitude[k];
    sums.square += p.weight[k] * std::norm(predicted[k]);
    sums.power += p.weight[k] * std::norm(p.amplitude[k]);
  }
  return sums;
}

// Maximum likelihood of one vector seen in all dwells, each with its own phase.
struct VectorFit {
  Vector3c vector = Vector3c::Zero();
  double nats = 0;
  double chi = 0;
};

VectorFit fit_vector(const std::vector<Phasor>& phasors, bool in_lab) {
  constexpr int kRounds = 25;  // phases and vector in turn; each round gains
  Eigen::Matrix3cd outer = Eigen::Matrix3cd::Zero();
  double weight = 0;
  for (const Phasor& p : phasors) {
    const Vector3c back = to_sensor(p, in_lab).transpose().cast<Complex>() * p.amplitude;
    outer += p.weight.mean() * back * back.adjoint();
    weight += p.weight.mean();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3cd> solver(outer);
  VectorFit fit;
  fit.vector = solver.eigenvectors().col(2);
  fit.vector *= std::sqrt(std::max(0.0, solver.eigenvalues()[2]) / std::max(1e-300, weight));
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
    Vector3c b = Vector3c::Zero();
    fit.nats = 0;
    fit.chi = 0;
    for (const Phasor& p : phasors) {
      const Eigen::Matrix3d r = to_sensor(p, in_lab);
      const Eigen::Matrix3d rw = r.transpose() * p.weight.asDiagonal();
      const auto [overlap, square, power] = overlap_of(r.cast<Complex>() * fit.vector, p);
      fit.nats += std::abs(overlap) - 0.5 * square;
      fit.chi += power - 2 * std::abs(overlap) + square;
      const Complex align =
          std::abs(overlap) > 0 ? std::conj(overlap) / std::abs(overlap) : Complex(1);
      a += rw * r;
      b += rw.cast<Complex>() * (p.amplitude * align);
    }
    fit.vector = a.inverse().cast<Complex>() * b;
  }
  return fit;
}

// log of the modified Bessel function I0 (Abramowitz and Stegun 9.8.1, 9.8.2): what a phase that is
// not known leaves of the exponential.
double log_bessel(double x) {
  if (x < 3.75) {
    const double t = x * x / 14.0625;
    return std::log(
        1 + t * (3.5156229 +
                 t * (3.0899424 +
                      t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
  }
  return x - 0.5 * std::log(2 * M_PI * x) + std::log1p(1 / (8 * x));
}

// Its derivative, I1 / I0: the mean cosine of a phase that is known that well.
double mean_cosine(double x) {
  constexpr double kLarge = 50;  // Abramowitz and Stegun 9.7.1 from there on
  return x < kLarge ? std::cyl_bessel_i(1, x) / std::cyl_bessel_i(0, x)
                    : 1 - 1 / (2 * x) - 1 / (8 * x * x);
}

// What dwells whose phases are known to each other say of a vector v: with one phase in common, the
// log likelihood over no line is |v'b| - v'Av / 2 where that phase is the likeliest.
struct Sums {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Vector3c b = Vector3c::Zero();

  void add(const Phasor& p, bool in_lab, Complex turn) {
    const Eigen::Matrix3d r = to_sensor(p, in_lab);
    const Eigen::Matrix3d back = r.transpose() * p.weight.asDiagonal();
    a += back * r;
    b += turn * (back.cast<Complex>() * p.amplitude);
  }
  double square(const Vector3c& v) const { return v.dot(a.cast<Complex>() * v).real(); }
};

// Each dwell has a phase of its own.
std::vector<Sums> each_alone(const std::vector<Phasor>& phasors, bool in_lab) {
  std::vector<Sums> all(phasors.size());
  for (std::size_t i = 0; i < phasors.size(); ++i) {
    all[i].add(phasors[i], in_lab, 1);
  }
  return all;
}

// Dwells within some minutes keep the phase by the host's clock. Long records stand alone: a unit's
// clock is not that good.
std::vector<Sums> in_step(const std::vector<Phasor>& phasors, double host_hz, bool in_lab) {
  constexpr double kLongest_s = 900;
  std::vector<Sums> all;
  std::optional<double> since_s;
  for (const Phasor& p : phasors) {
    const bool is_dwell = p.seconds <= kDwell_s;
    if (!since_s || !is_dwell || p.start_s - *since_s > kLongest_s) {
      all.emplace_back();
      since_s = p.start_s;
    }
    all.back().add(p, in_lab, std::polar(1.0, -2 * M_PI * host_hz * (p.start_s - *since_s)));
    if (!is_dwell) {
      since_s.reset();
    }
  }
  return all;
}

// Maximum likelihood of a vector of its own for each of the sums.
struct OwnVectors {
  double nats = 0;
  Vector3c strongest = Vector3c::Zero();  // of the one that says most
};

OwnVectors own_vectors(const std::vector<Sums>& all) {
  OwnVectors out;
  double most = -1;
  for (const Sums& sums : all) {
    const Vector3c vector = sums.a.inverse().cast<Complex>() * sums.b;
    const double own = 0.5 * sums.b.dot(vector).real();
    out.nats += own;
    if (own > most) {
      most = own;
      out.strongest = vector;
    }
  }
  return out;
}

struct HostFrequency {
  double hz = 0;
  double search_nats = 0;  // what the search for it costs
};

// The frequency near `found_hz` at which the dwells in step agree best: that was found by the
// unit's clock, which goes wrong by some 1e-4.
HostFrequency host_frequency(const std::vector<Phasor>& phasors, double found_hz, bool in_lab) {
  constexpr double kClock = 2e-4, kStep_hz = 3e-4;  // the step is a quarter of a turn in 900 s
  const int steps = static_cast<int>(std::ceil(kClock * found_hz / kStep_hz));
  HostFrequency best{found_hz, std::log(2.0 * steps + 1)};
  double most = -1;
  for (int k = -steps; k <= steps; ++k) {
    const double hz = found_hz + k * kStep_hz;
    if (const double nats = own_vectors(in_step(phasors, hz, in_lab)).nats; nats > most) {
      most = nats;
      best.hz = hz;
    }
  }
  return best;
}

// The vector of the highest likelihood averaged over the phases (EM; Dempster et al. 1977), from a
// guess. fit_vector() takes the likeliest phase of each: then noise adds to a small vector, since
// it is turned into its direction everywhere (too many parameters; Neyman and Scott 1948).
Vector3c without_phases(const std::vector<Sums>& all, Vector3c vector) {
  constexpr int kRounds = 50;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  for (const Sums& sums : all) {
    a += sums.a;
  }
  const Eigen::Matrix3cd inverse = a.inverse().cast<Complex>();
  for (int round = 0; round < kRounds; ++round) {
    Vector3c b = Vector3c::Zero();
    for (const Sums& sums : all) {
      const Complex overlap = vector.dot(sums.b);
      const double known = std::abs(overlap);
      if (known > 0) {
        b += sums.b * (mean_cosine(known) / known * std::conj(overlap));
      }
    }
    vector = inverse * b;
  }
  return vector;
}

// Log likelihood of the vector over no line, averaged over the phases.
double averaged_nats(const std::vector<Sums>& all, const Vector3c& vector) {
  double nats = 0;
  for (const Sums& sums : all) {
    nats += log_bessel(std::abs(vector.dot(sums.b))) - 0.5 * sums.square(vector);
  }
  return nats;
}

std::vector<Phasor> phasors_at(double rate_hz, const std::vector<Stretch>& all,
                               const NoiseSpectrum& noise, double frequency_hz) {
  std::vector<Phasor> phasors;
  phasors.reserve(all.size());
  for (const Stretch& s : all) {
    phasors.push_back({amplitude_at(s, 2 * M_PI * frequency_hz / rate_hz),
                       weights_at(s, noise, frequency_hz), s.rotation, s.pose, s.start_s,
                       static_cast<double>(s.samples) / rate_hz});
  }
  return phasors;
}

// A line in one frame, whether it keeps its phase or not.
struct OneFrame {
  bool in_lab = true;
  bool keeps_phase = false;  // by the host's clock, from dwell to dwell
  double host_hz = 0;        // if so
  Vector3c vector = Vector3c::Zero();
  double averaged_nats = 0;   // log likelihood over no line, averaged over the phases that are free
  double likeliest_nats = 0;  // the same, less what the search for host_hz costs
  double gain_nats = 0;       // with the likeliest phases
  double chi = 0;             // of the dwells, each with its likeliest phase
};

OneFrame in_frame(const std::vector<Phasor>& phasors, double found_hz, bool in_lab) {
  const VectorFit fit = fit_vector(phasors, in_lab);
  const std::vector<Sums> alone = each_alone(phasors, in_lab);
  OneFrame out{.in_lab = in_lab, .gain_nats = fit.nats, .chi = fit.chi};
  out.vector = without_phases(alone, fit.vector);
  out.averaged_nats = averaged_nats(alone, out.vector);
  out.likeliest_nats = out.averaged_nats;
  // A small line drowns in each dwell, and fits noise there by its free phase: only the sum of
  // dwells that keep its phase shows the frame.
  const HostFrequency host = host_frequency(phasors, found_hz, in_lab);
  const std::vector<Sums> together = in_step(phasors, host.hz, in_lab);
  const Vector3c vector = without_phases(together, own_vectors(together).strongest);
  const double nats = averaged_nats(together, vector);
  if (nats - host.search_nats > out.likeliest_nats) {
    out.keeps_phase = true;
    out.host_hz = host.hz;
    out.vector = vector;
    out.averaged_nats = nats;
    out.likeliest_nats = nats - host.search_nats;
    out.gain_nats = 0;
    for (const Sums& sums : together) {
      out.gain_nats += std::abs(vector.dot(sums.b)) - 0.5 * sums.square(vector);
    }
  }
  return out;
}

// The poses in two halves, each with a vector of its own.
struct Halves {
  double held_out_nats = 0;  // each predicted from the vector of the other
  double own_nats = 0;       // each by its own
};

std::optional<Halves> halves_of(const std::vector<Phasor>& phasors, const OneFrame& line) {
  std::array<std::vector<Sums>, 2> half;
  std::array<Vector3c, 2> vector;
  for (std::size_t k = 0; k < 2; ++k) {
    std::vector<Phasor> own;
    std::ranges::copy_if(phasors, std::back_inserter(own), [&](const Phasor& p) {
      return static_cast<std::size_t>(p.pose % 2) == k;
    });
    if (own.empty()) {
      return std::nullopt;
    }
    half[k] =
        line.keeps_phase ? in_step(own, line.host_hz, line.in_lab) : each_alone(own, line.in_lab);
    vector[k] = without_phases(half[k], line.keeps_phase ? own_vectors(half[k]).strongest
                                                         : fit_vector(own, line.in_lab).vector);
  }
  Halves halves;
  for (std::size_t k = 0; k < 2; ++k) {
    halves.held_out_nats += averaged_nats(half[1 - k], vector[k]);
    halves.own_nats += averaged_nats(half[k], vector[k]);
  }
  return halves;
}

struct Peak {
  double frequency_hz = 0;
  double nats = 0;  // above the threshold
};

// Stretches of more than `least` samples, in equal pieces of at most `most`.
std::vector<Stretch> pieces(const std::vector<Stretch>& all, double least, double most) {
  std::vector<Stretch> cut;
  for (const Stretch& s : all) {
    if (static_cast<double>(s.samples) <= least) {
      continue;
    }
    const auto count = static_cast<std::size_t>(std::ceil(static_cast<double>(s.samples) / most));
    const std::size_t length = s.samples / count;
    for (std::size_t k = 0; k < count; ++k) {
      Stretch piece = s;
      piece.samples = length;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto first = s.x[a].begin() + static_cast<std::ptrdiff_t>(k * length);
        piece.x[a].assign(first, first + static_cast<std::ptrdiff_t>(length));
      }
      const auto first = s.is_known.begin() + static_cast<std::ptrdiff_t>(k * length);
      piece.is_known.assign(first, first + static_cast<std::ptrdiff_t>(length));
      piece.known =
          static_cast<std::size_t>(std::count(piece.is_known.begin(), piece.is_known.end(), true));
      if (piece.known > 0) {
        cut.push_back(std::move(piece));
      }
    }
  }
  return cut;
}

// Finds one line after the other, the strongest first, and takes it off before it seeks the next:
// what is masked spreads a strong line over its neighbourhood.
class LineFinder {
 public:
  LineFinder(double rate_hz, const NoiseSpectrum& noise, std::vector<Stretch> all)
      : rate_hz_(rate_hz), noise_(noise), all_(std::move(all)) {
    longest_ = &*std::max_element(all_.begin(), all_.end(), [](const Stretch& a, const Stretch& b) {
      return a.samples < b.samples;
    });
  }

  // `found`: the lines so far, which are stronger.
  std::optional<SpectralLine> next(const std::vector<SpectralLine>& found) {
    std::optional<Peak> best;
    Kind kind = Kind::in_step;
    double step_hz = 0;
    for (const auto& [of, scan] : scans()) {
      if (found.empty() && !scan.nats.empty()) {
        const double own_mg = shown_line_mg(scan, threshold_nats(scan), white_mg2());
        bound_mg_ = std::min(bound_mg_.value_or(own_mg), own_mg);
      }
      const auto peak = best_peak(scan);
      if (peak && (!best || peak->nats > best->nats)) {
        best = peak;
        kind = of;
        step_hz = scan.step_hz;
      }
    }
    if (!best) {
      return std::nullopt;
    }
    const double f = refined(best->frequency_hz, kind, step_hz);
    taken_hz_.push_back(f);
    taken_hz_.push_back(rate_hz_ / 2 - std::abs(rate_hz_ / 2 - f));
    const SpectralLine line = line_at(f, harmonic_nats(f, found));
    for (Stretch& stretch : all_) {
      take_off(stretch, 2 * M_PI * f / rate_hz_);
    }
    return line;
  }

  // Once the first was looked for.
  std::optional<double> bound_mg() const { return bound_mg_; }

 private:
  enum class Kind { of_long, of_dwells, in_step };

  static double threshold_nats(const LineScan& scan) {
    return std::log(static_cast<double>(scan.nats.size())) - std::log(kFalseLines);
  }
  Eigen::Vector3d white_mg2() const {
    return Eigen::Vector3d(noise_.white_mg[0], noise_.white_mg[1], noise_.white_mg[2]).cwiseAbs2();
  }

  std::vector<std::pair<Kind, LineScan>> scans() const {
    constexpr double kLong_s = 60;
    constexpr double kPiece_s = 327;  // of long records: 2^15 samples at 100 Hz in one transform
    std::vector<std::pair<Kind, LineScan>> scans;
    std::vector<const Stretch*> dwells;
    for (const Stretch& s : all_) {
      if (static_cast<double>(s.samples) <= kDwell_s * rate_hz_) {
        dwells.push_back(&s);
      }
    }
    if (static_cast<double>(longest_->samples) > kLong_s * rate_hz_) {
      const std::vector<Stretch> cut = pieces(all_, kLong_s * rate_hz_, kPiece_s * rate_hz_);
      std::vector<const Stretch*> set;
      set.reserve(cut.size());
      for (const Stretch& piece : cut) {
        set.push_back(&piece);
      }
      scans.emplace_back(Kind::of_long, scan_powers(rate_hz_, set, noise_));
    } else {
      scans.emplace_back(Kind::in_step, scan_in_step(rate_hz_, all_, noise_));
    }
    if (!dwells.empty()) {
      scans.emplace_back(Kind::of_dwells, scan_powers(rate_hz_, dwells, noise_));
    }
    return scans;
  }

  std::optional<Peak> best_peak(const LineScan& scan) const {
    constexpr double kGuard_hz = 0.6;  // convention: wider than a line in a dwell of 7 s
    std::optional<Peak> best;
    if (scan.nats.empty()) {
      return best;
    }
    const auto first = static_cast<std::size_t>(std::ceil(kLowest_hz / scan.step_hz));
    for (std::size_t k = first; k + 2 < scan.nats.size(); ++k) {
      const double nats = scan.nats[k] - threshold_nats(scan);
      if (nats > 0 && (!best || nats > best->nats)) {
        const double f = static_cast<double>(k) * scan.step_hz;
        if (std::none_of(taken_hz_.begin(), taken_hz_.end(),
                         [&](double t) { return std::abs(t - f) < kGuard_hz; })) {
          best = Peak{f, nats};
        }
      }
    }
    return best;
  }

  // The frequency of most power near `f`, in what the scan was made of.
  double refined(double f, Kind kind, double step_hz) const {
    double best = -1;
    for (const double finer : {4.0, 20.0}) {
      const double centre = f;
      for (int k = -4; k <= 4; ++k) {
        const double candidate = centre + k * (step_hz / finer);
        if (const double power = power_at(candidate, kind); power > best) {
          best = power;
          f = candidate;
        }
      }
    }
    return f;
  }

  double power_at(double f, Kind kind) const {
    if (kind == Kind::in_step) {
      const auto phasors = phasors_at(rate_hz_, all_, noise_, f);
      return std::max(own_vectors(in_step(phasors, f, true)).nats,
                      own_vectors(in_step(phasors, f, false)).nats);
    }
    double sum = 0;
    const double w = 2 * M_PI * f / rate_hz_;
    for (const Stretch& s : all_) {
      if (kind == Kind::of_dwells || &s == longest_) {
        sum += amplitude_at(s, w).squaredNorm() * static_cast<double>(s.known);
      }
    }
    return sum;
  }

  // What a stronger line says of the frame (laboratory over sensor) of its second or third
  // harmonic: one motor, or one supply, makes both.
  double harmonic_nats(double f, const std::vector<SpectralLine>& found) const {
    constexpr double kSameSource_nats = 5;  // convention: chance puts a line there once in 150
    constexpr double kSame_hz = 0.02;
    for (const SpectralLine& line : found) {
      for (const int order : {2, 3}) {
        const double harmonic_hz = order * line.frequency_hz;
        const double folded_hz = std::abs(std::remainder(harmonic_hz, rate_hz_));
        if (std::abs(folded_hz - f) < kSame_hz) {
          return line.in_lab ? kSameSource_nats : -kSameSource_nats;
        }
      }
    }
    return 0;
  }

  SpectralLine line_at(double f, double harmonic_nats) const {
    constexpr double kOneFrame_nats = 3;  // one in twenty: convention
    SpectralLine line;
    line.frequency_hz = f;
    const auto phasors = phasors_at(rate_hz_, all_, noise_, f);
    const OneFrame lab = in_frame(phasors, f, true);
    const OneFrame sensor = in_frame(phasors, f, false);
    line.lab_over_sensor_nats = harmonic_nats + lab.likeliest_nats - sensor.likeliest_nats;
    line.in_lab = line.lab_over_sensor_nats > 0;
    const OneFrame& chosen = line.in_lab ? lab : sensor;
    const Vector3c& vector = chosen.vector;
    line.gain_nats = chosen.gain_nats;
    line.averaged_nats = chosen.likeliest_nats;
    if (const auto halves = halves_of(phasors, chosen)) {
      line.held_out_nats = halves->held_out_nats;
      line.apart_nats = halves->own_nats - chosen.averaged_nats;
    }
    // Turn the common phase so that the vector is as real as can be.
    const Complex square = (vector.transpose() * vector).value();
    line.vector_mg = (vector * std::polar(1.0, -0.5 * std::arg(square))).real();
    double weight = 0;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Phasor& p : phasors) {
      // Information of a dwell on the size, where its phase is free: all of it from a few standard
      // deviations on, and nothing of what drowns in noise.
      const double signal = p.weight.mean() * vector.squaredNorm();
      weight += p.weight.mean() * (chosen.keeps_phase ? 1 : signal / (1 + signal));
      spread += (p.rotation - phasors.front().rotation).cwiseAbs();
    }
    line.sd_mg = 1 / std::sqrt(std::max(1e-12, weight));
    const double freedom = static_cast<double>(phasors.size()) * 5 - 5;
    line.misfit_sd = (chosen.chi - freedom) / std::sqrt(2 * std::max(1.0, freedom));
    line.decidable =
        spread.maxCoeff() > 0.5 && std::abs(line.lab_over_sensor_nats) > kOneFrame_nats;
    return line;
  }

  double rate_hz_;
  const NoiseSpectrum& noise_;
  std::vector<Stretch> all_;
  const Stretch* longest_ = nullptr;
  std::vector<double> taken_hz_;
  std::optional<double> bound_mg_;
};

}  // namespace

FoundLines find_lines(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  constexpr std::size_t kMost = 8;
  constexpr int kMostTried = 16;
  FoundLines found;
  std::vector<SpectralLine>& lines = found.lines;
  auto all = noise.usable() ? stretches(bundle, clean) : std::vector<Stretch>{};
  if (all.empty()) {
    return found;
  }
  LineFinder finder(bundle.rate_hz, noise, std::move(all));
  // Strongest first: a dwell of some seconds spreads a line over its neighbourhood.
  const auto spread_of = [](const SpectralLine& strong, const SpectralLine& line) {
    constexpr double kReach_hz = 3, kShare = 0.03;
    return std::abs(strong.frequency_hz - line.frequency_hz) < kReach_hz &&
           line.vector_mg.norm() < kShare * strong.vector_mg.norm();
  };
  for (int tried = 0; tried < kMostTried && lines.size() < kMost; ++tried) {
    const auto line = finder.next(lines);
    if (!line) {
      break;
    }
    if (std::none_of(lines.begin(), lines.end(),
                     [&](const SpectralLine& strong) { return spread_of(strong, *line); })) {
      lines.push_back(*line);
    }
  }
  std::sort(lines.begin(), lines.end(),
            [](const SpectralLine& a, const SpectralLine& b) { return a.gain_nats > b.gain_nats; });
  found.bound_mg = finder.bound_mg();
  return found;
}

}  // namespace sixpoint::gap
