#include "gap/features/lines.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>
#include <unsupported/Eigen/FFT>

namespace sixpoint::gap {
namespace {

using Complex = std::complex<double>;
using Vector3c = Eigen::Vector3cd;

constexpr double kLowest_hz = 3;  // below it slow noise rules; vibration of floors is faster
// Chance of one false line in a whole recording. One false alarm in a hundred recordings is what
// the whole diagnosis is allowed; some ten kinds of decision share it evenly.
constexpr double kFalseLines = 1e-3;
constexpr std::size_t kLongest = 1U << 17;  // 22 minutes at 100 Hz

// A stretch at rest in one pose, mean removed, masked samples zero, in mg.
struct Stretch {
  std::size_t segment = 0;
  std::size_t samples = 0;
  std::array<std::vector<double>, 3> x;
};

std::vector<Stretch> stretches(const Bundle& bundle, const CleanSamples& clean) {
  std::vector<Stretch> all;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const Segment& segment = bundle.segments[s];
    if (segment.kind == Segment::Kind::vibration || segment.kind == Segment::Kind::ramp) {
      continue;
    }
    const std::size_t skip = segment.may_ring() ? static_cast<std::size_t>(3 * bundle.rate_hz) : 0;
    if (segment.samples < skip + static_cast<std::size_t>(4 * bundle.rate_hz)) {
      continue;
    }
    Stretch stretch;
    stretch.segment = s;
    stretch.samples = std::min(segment.samples - skip, kLongest);
    std::size_t good = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto& x = stretch.x[axis];
      x.assign(stretch.samples, 0);
      double mean = 0;
      good = 0;
      for (std::size_t i = 0; i < stretch.samples; ++i) {
        const std::size_t at = segment.first_sample + skip + i;
        if ((clean.flags[at] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0) {
          x[i] = 1000.0 * clean.samples[at][axis] / bundle.accel_scale_lsb_per_g;
          mean += x[i];
          ++good;
        }
      }
      mean /= static_cast<double>(std::max<std::size_t>(1, good));
      for (std::size_t i = 0; i < stretch.samples; ++i) {
        const std::size_t at = segment.first_sample + skip + i;
        if ((clean.flags[at] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0) {
          x[i] -= mean;
        }
      }
    }
    if (good * 10 >= stretch.samples * 9) {
      all.push_back(std::move(stretch));
    }
  }
  return all;
}

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
  return sum * (2.0 / static_cast<double>(stretch.samples));
}

// One dwell's complex amplitude, its weights and its pose.
struct Sight {
  Vector3c amplitude;
  Eigen::Vector3d weight;  // 1 / variance of the real part
  Eigen::Matrix3d rotation;
  int pose = 0;
};

// Maximum likelihood of one vector seen in all dwells, each with its own phase.
struct VectorFit {
  Vector3c vector = Vector3c::Zero();
  double nats = 0;
  double chi = 0;
};

VectorFit fit_vector(const std::vector<Sight>& sights, bool in_lab) {
  const auto to_sensor = [&](const Sight& s) -> Eigen::Matrix3d {
    return in_lab ? s.rotation : Eigen::Matrix3d::Identity();
  };
  Eigen::Matrix3cd outer = Eigen::Matrix3cd::Zero();
  for (const Sight& s : sights) {
    const Vector3c back = to_sensor(s).transpose().cast<Complex>() * s.amplitude;
    outer += s.weight.mean() * back * back.adjoint();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3cd> solver(outer);
  VectorFit fit;
  fit.vector = solver.eigenvectors().col(2);
  double weight = 0;
  for (const Sight& s : sights) {
    weight += s.weight.mean();
  }
  fit.vector *= std::sqrt(std::max(0.0, solver.eigenvalues()[2]) / std::max(1e-300, weight));
  for (int round = 0; round < 25; ++round) {
    Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
    Vector3c b = Vector3c::Zero();
    fit.nats = 0;
    fit.chi = 0;
    for (const Sight& s : sights) {
      const Eigen::Matrix3d r = to_sensor(s);
      const Eigen::Matrix3d rw = r.transpose() * s.weight.asDiagonal();
      const Vector3c predicted = r.cast<Complex>() * fit.vector;
      Complex overlap = 0;
      double square = 0;
      double power = 0;
      for (Eigen::Index k = 0; k < 3; ++k) {
        overlap += std::conj(predicted[k]) * s.weight[k] * s.amplitude[k];
        square += s.weight[k] * std::norm(predicted[k]);
        power += s.weight[k] * std::norm(s.amplitude[k]);
      }
      fit.nats += std::abs(overlap) - 0.5 * square;
      fit.chi += power - 2 * std::abs(overlap) + square;
      const Complex align =
          std::abs(overlap) > 0 ? std::conj(overlap) / std::abs(overlap) : Complex(1);
      a += rw * r;
      b += rw.cast<Complex>() * (s.amplitude * align);
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

double held_out_line_nats(const std::vector<Sight>& sights, bool in_lab) {
  std::array<std::vector<Sight>, 2> half;
  for (const Sight& s : sights) {
    half[static_cast<std::size_t>(s.pose % 2)].push_back(s);
  }
  if (half[0].empty() || half[1].empty()) {
    return 0;
  }
  double nats = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const Vector3c vector = fit_vector(half[k], in_lab).vector;
    for (const Sight& s : half[1 - k]) {
      const Eigen::Matrix3d turn = in_lab ? s.rotation : Eigen::Matrix3d::Identity();
      const Vector3c predicted = turn.cast<Complex>() * vector;
      Complex overlap = 0;
      double square = 0;
      for (Eigen::Index a = 0; a < 3; ++a) {
        overlap += std::conj(predicted[a]) * s.weight[a] * s.amplitude[a];
        square += s.weight[a] * std::norm(predicted[a]);
      }
      nats += log_bessel(std::abs(overlap)) - 0.5 * square;
    }
  }
  return nats;
}

std::vector<Sight> sights_at(const Bundle& bundle, const std::vector<Stretch>& all,
                             const NoiseSpectrum& noise, double frequency_hz) {
  std::vector<Sight> sights;
  const double w = 2 * M_PI * frequency_hz / bundle.rate_hz;
  for (const Stretch& stretch : all) {
    Sight sight;
    sight.amplitude = amplitude_at(stretch, w);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sight.weight[static_cast<Eigen::Index>(axis)] =
          static_cast<double>(stretch.samples) / (2 * noise.variance_at(axis, frequency_hz));
    }
    sight.rotation = bundle.segments[stretch.segment].rotation;
    sight.pose = bundle.segments[stretch.segment].pose;
    sights.push_back(sight);
  }
  return sights;
}

double stretch_start_s(const Bundle& bundle, const Stretch& stretch) {
  const Segment& segment = bundle.segments[stretch.segment];
  return segment.host_start_s +
         static_cast<double>(segment.samples - stretch.samples) / bundle.rate_hz;
}

struct Peak {
  double frequency_hz = 0;
  double nats = 0;  // above the threshold
};

// Per frequency, how much of a line there is: the largest eigenvalue of the dwells' outer products,
// turned back into the laboratory or left in the sensor. A line has one direction, noise all three,
// so that this sees weaker lines than the sum of powers. Without a line the matrix follows
// Wishart's law; its largest eigenvalue the shifted gamma law of Chiani (2014, beta = 2).
struct LineScan {
  std::vector<double> nats;  // -log of the chance, per frequency
  double step_hz = 0;
};

constexpr double kChianiShape = 79.6595;
constexpr double kChianiScale = 0.101037;
constexpr double kChianiShift = 9.81961;

// log of the upper tail of a gamma law of shape m, scale 1 (Chernoff's bound, exact enough here).
double log_tail(double x, double m) { return x <= m ? 0 : -(x - m - m * std::log(x / m)); }

double eigenvalue_nats(double largest, std::size_t looks) {
  if (looks == 1) {
    return -log_tail(largest, 3);  // one look: all power is in one direction
  }
  const double n = std::sqrt(static_cast<double>(looks));
  const double m = std::sqrt(3.0);
  const double centre = (n + m) * (n + m);
  const double width = (n + m) * std::cbrt(1 / n + 1 / m);
  return -log_tail(((largest - centre) / width + kChianiShift) / kChianiScale, kChianiShape);
}

LineScan scan(const Bundle& bundle, const std::vector<const Stretch*>& set,
              const NoiseSpectrum& noise) {
  LineScan out;
  std::size_t length = 2;
  for (const Stretch* s : set) {
    while (length < s->samples) {
      length *= 2;
    }
  }
  length *= 2;  // half-bin steps: a line between two bins loses little
  const std::size_t half = length / 2;
  out.step_hz = bundle.rate_hz / static_cast<double>(length);
  out.nats.assign(half, 0);
  std::array<std::vector<double>, 3> level;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // The noise level on a coarse grid: it is smooth, the bins are many.
    const std::size_t coarse = 400;
    std::vector<double> grid(coarse + 1);
    for (std::size_t k = 0; k <= coarse; ++k) {
      grid[k] = noise.variance_at(axis, 0.5 * bundle.rate_hz * static_cast<double>(k) / coarse);
    }
    level[axis].resize(half);
    for (std::size_t k = 0; k < half; ++k) {
      level[axis][k] = grid[k * coarse / half];
    }
  }
  Eigen::FFT<double> fft;
  std::array<std::vector<Complex>, 3> spectrum;
  const bool one = set.size() == 1;
  std::vector<Eigen::Matrix3cd> lab(one ? 0 : half, Eigen::Matrix3cd::Zero());
  std::vector<Eigen::Matrix3cd> sensor(one ? 0 : half, Eigen::Matrix3cd::Zero());
  for (const Stretch* s : set) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> x = s->x[axis];
      x.resize(length, 0);
      fft.fwd(spectrum[axis], x);
    }
    const double scale = 1 / std::sqrt(static_cast<double>(s->samples));
    const Eigen::Matrix3cd back = bundle.segments[s->segment].rotation.transpose().cast<Complex>();
    for (std::size_t k = 0; k < half; ++k) {
      Vector3c z;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        z[static_cast<Eigen::Index>(axis)] =
            spectrum[axis][k] * (scale / std::sqrt(level[axis][k]));
      }
      if (one) {
        out.nats[k] = eigenvalue_nats(z.squaredNorm(), 1);
        continue;
      }
      sensor[k] += z * z.adjoint();
      z = back * z;
      lab[k] += z * z.adjoint();
    }
  }
  for (std::size_t k = 0; k < half && !one; ++k) {
    // The trace bounds the eigenvalue: most bins need no decomposition.
    const auto largest = [&](const Eigen::Matrix3cd& m) {
      const double trace = m.trace().real();
      if (trace < 3.0 * static_cast<double>(set.size())) {
        return trace / 3;
      }
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3cd> solver;
      solver.computeDirect(m, Eigen::EigenvaluesOnly);
      return solver.eigenvalues()[2];
    };
    const double most = std::max(largest(lab[k]), largest(sensor[k]));
    out.nats[k] = eigenvalue_nats(most, set.size()) - std::log(2.0);  // two frames were tried
  }
  return out;
}

// Where no long record is, dwells within some minutes are summed with the phases that one line
// would have by the host's clock: a sum of eighteen dwells sees a line of a third of the size that
// their powers show.
LineScan coherent_scan(const Bundle& bundle, const std::vector<Stretch>& set,
                       const NoiseSpectrum& noise) {
  constexpr double kLongest_s = 900;
  constexpr std::size_t kCoarse = 64;
  LineScan out;
  std::vector<const Stretch*> near;
  double first_s = 0;
  for (const Stretch& s : set) {
    const double t = stretch_start_s(bundle, s);
    first_s = near.empty() ? t : first_s;
    if (t - first_s < kLongest_s) {
      near.push_back(&s);
    }
  }
  if (near.size() < 4) {
    return out;
  }
  const double span_s = stretch_start_s(bundle, *near.back()) - first_s + 10;
  std::size_t length = 1024;
  while (static_cast<double>(length) < 1.5 * span_s * bundle.rate_hz) {
    length *= 2;
  }
  const std::size_t half = length / 2;
  out.step_hz = bundle.rate_hz / static_cast<double>(length);
  out.nats.assign(half, 0);
  // Maximum likelihood per frequency: b' A^-1 b with b the sum of the dwells' weighted spectra,
  // each turned into the frame, and A its covariance. Noise gives it a gamma law of shape 3.
  constexpr std::size_t kHalfCoarse = kCoarse / 2;
  std::array<std::vector<double>, 3> weight;  // 1 / variance, on a coarse grid: noise is smooth
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < half; k += kCoarse) {
      weight[axis].push_back(
          1 / noise.variance_at(axis, static_cast<double>(k + kHalfCoarse) * out.step_hz));
    }
  }
  std::vector<Vector3c> lab(half, Vector3c::Zero());
  std::vector<Vector3c> sensor(half, Vector3c::Zero());
  Eigen::FFT<double> fft;
  std::array<std::vector<Complex>, 3> spectrum;
  std::vector<double> x;
  for (const Stretch* s : near) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      x = s->x[axis];
      x.resize(length, 0);
      fft.fwd(spectrum[axis], x);
    }
    const Eigen::Matrix3cd back = bundle.segments[s->segment].rotation.transpose().cast<Complex>();
    const Complex turn =
        std::polar(1.0, -2 * M_PI * out.step_hz * (stretch_start_s(bundle, *s) - first_s));
    Complex phase = 1;
    for (std::size_t k = 0; k < half; ++k) {
      const std::size_t c = k / kCoarse;
      const Vector3c z =
          phase * Vector3c(spectrum[0][k] * weight[0][c], spectrum[1][k] * weight[1][c],
                           spectrum[2][k] * weight[2][c]);
      sensor[k] += z;
      lab[k] += back * z;
      phase *= turn;
    }
  }
  Eigen::Matrix3d lab_covariance;
  Eigen::Matrix3d sensor_covariance;
  for (std::size_t k = 0; k < half; ++k) {
    if (k % kCoarse == 0) {
      lab_covariance.setZero();
      sensor_covariance.setZero();
      const std::size_t c = k / kCoarse;
      const Eigen::Matrix3d white =
          Eigen::Vector3d(weight[0][c], weight[1][c], weight[2][c]).asDiagonal();
      for (const Stretch* s : near) {
        const Eigen::Matrix3d& r = bundle.segments[s->segment].rotation;
        sensor_covariance += static_cast<double>(s->samples) * white;
        lab_covariance += static_cast<double>(s->samples) * (r.transpose() * white * r);
      }
      lab_covariance = lab_covariance.inverse().eval();
      sensor_covariance = sensor_covariance.inverse().eval();
    }
    const auto power = [](const Vector3c& b, const Eigen::Matrix3d& inverse) {
      return b.real().dot(inverse * b.real()) + b.imag().dot(inverse * b.imag());
    };
    out.nats[k] =
        -log_tail(std::max(power(sensor[k], sensor_covariance), power(lab[k], lab_covariance)), 3) -
        std::log(2.0);
  }
  return out;
}

// The likeliest vector of a line that keeps its phase by the host's clock; chi is not set.
VectorFit coherent_sum(const Bundle& bundle, const std::vector<Stretch>& all,
                       const NoiseSpectrum& noise, double frequency_hz, bool in_lab) {
  const double w = 2 * M_PI * frequency_hz;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Vector3c b = Vector3c::Zero();
  for (const Stretch& s : all) {
    const double t = stretch_start_s(bundle, s) - stretch_start_s(bundle, all.front());
    const Eigen::Matrix3d to_sensor =
        in_lab ? bundle.segments[s.segment].rotation : Eigen::Matrix3d::Identity();
    Eigen::Vector3d weight;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      weight[static_cast<Eigen::Index>(axis)] =
          static_cast<double>(s.samples) / (2 * noise.variance_at(axis, frequency_hz));
    }
    const Eigen::Matrix3d back = to_sensor.transpose() * weight.asDiagonal();
    a += back * to_sensor;
    b += back.cast<Complex>() * (amplitude_at(s, w / bundle.rate_hz) * std::polar(1.0, -w * t));
  }
  VectorFit fit;
  fit.vector = a.inverse().cast<Complex>() * b;
  fit.nats = 0.5 * (fit.vector.dot(b)).real();
  return fit;
}

std::optional<Peak> best_peak(const LineScan& power, const std::vector<double>& taken_hz,
                              double guard_hz) {
  std::optional<Peak> best;
  const auto first = static_cast<std::size_t>(std::ceil(kLowest_hz / power.step_hz));
  const double log_bins = std::log(static_cast<double>(power.nats.size()));
  for (std::size_t k = first; k + 2 < power.nats.size(); ++k) {
    const double nats = power.nats[k] - log_bins + std::log(kFalseLines);
    if (nats > 0 && (!best || nats > best->nats)) {
      const double f = static_cast<double>(k) * power.step_hz;
      const bool free = std::none_of(taken_hz.begin(), taken_hz.end(),
                                     [&](double t) { return std::abs(t - f) < guard_hz; });
      if (free) {
        best = Peak{f, nats};
      }
    }
  }
  return best;
}

}  // namespace

LineSearch find_lines(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise) {
  LineSearch search;
  if (!noise.usable()) {
    return search;
  }
  const auto all = stretches(bundle, clean);
  if (all.empty()) {
    return search;
  }
  const auto longest =
      std::max_element(all.begin(), all.end(),
                       [](const Stretch& a, const Stretch& b) { return a.samples < b.samples; });
  std::vector<const Stretch*> dwells;
  for (const Stretch& s : all) {
    if (static_cast<double>(s.samples) <= 30 * bundle.rate_hz) {
      dwells.push_back(&s);
    }
  }
  enum class Scan { of_longest, of_dwells, in_step };
  std::vector<std::pair<Scan, LineScan>> powers;
  if (static_cast<double>(longest->samples) > 60 * bundle.rate_hz) {
    powers.emplace_back(Scan::of_longest, scan(bundle, {&*longest}, noise));
  } else {
    powers.emplace_back(Scan::in_step, coherent_scan(bundle, all, noise));
  }
  if (!dwells.empty()) {
    powers.emplace_back(Scan::of_dwells, scan(bundle, dwells, noise));
  }
  std::vector<double> taken;
  while (search.lines.size() < 4) {
    std::optional<Peak> peak;
    const LineScan* from = nullptr;
    Scan kind = Scan::of_dwells;
    for (const auto& [scanned, power] : powers) {
      const auto found = best_peak(power, taken, 0.6);
      if (found && (!peak || found->nats > peak->nats)) {
        peak = found;
        from = &power;
        kind = scanned;
      }
    }
    if (!peak) {
      break;
    }
    // Refine where the found peak was seen.
    double f = peak->frequency_hz;
    double best = -1;
    for (int round = 0; round < 2; ++round) {
      const double step = from->step_hz / (round == 0 ? 4 : 20);
      const double centre = f;
      for (int k = -4; k <= 4; ++k) {
        const double candidate = centre + k * step;
        double sum = 0;
        const double w = 2 * M_PI * candidate / bundle.rate_hz;
        if (kind == Scan::in_step) {
          sum = std::max(coherent_sum(bundle, all, noise, candidate, true).nats,
                         coherent_sum(bundle, all, noise, candidate, false).nats);
        }
        for (const Stretch& s : all) {
          if (kind == Scan::of_dwells || (kind == Scan::of_longest && &s == &*longest)) {
            sum += amplitude_at(s, w).squaredNorm() * static_cast<double>(s.samples);
          }
        }
        if (sum > best) {
          best = sum;
          f = candidate;
        }
      }
    }
    SpectralLine line;
    line.frequency_hz = f;
    const auto sights = sights_at(bundle, all, noise, f);
    VectorFit lab = fit_vector(sights, true);
    VectorFit sensor = fit_vector(sights, false);
    if (kind == Scan::in_step) {
      const VectorFit lab_in_step = coherent_sum(bundle, all, noise, f, true);
      const VectorFit sensor_in_step = coherent_sum(bundle, all, noise, f, false);
      // A line that keeps its phase: the frame is told by the sum, too.
      if (std::max(lab_in_step.nats, sensor_in_step.nats) >
          std::max(lab.nats, sensor.nats) - static_cast<double>(sights.size())) {
        const double chi_lab = lab.chi;
        const double chi_sensor = sensor.chi;
        lab = lab_in_step;
        sensor = sensor_in_step;
        lab.chi = chi_lab;
        sensor.chi = chi_sensor;
      }
    }
    line.lab_over_sensor_nats = lab.nats - sensor.nats;
    line.in_lab = line.lab_over_sensor_nats > 0;
    const VectorFit& chosen = line.in_lab ? lab : sensor;
    line.gain_nats = chosen.nats;
    line.held_out_nats = held_out_line_nats(sights, line.in_lab);
    // Turn the common phase so that the vector is as real as can be.
    Complex square = 0;
    for (Eigen::Index k = 0; k < 3; ++k) {
      square += chosen.vector[k] * chosen.vector[k];
    }
    const Complex turn = std::polar(1.0, -0.5 * std::arg(square));
    line.vector_mg = (chosen.vector * turn).real();
    double weight = 0;
    for (const Sight& s : sights) {
      weight += s.weight.mean();
    }
    line.sd_mg = 1 / std::sqrt(weight);
    const double freedom = static_cast<double>(sights.size()) * 5 - 5;
    line.misfit_sd = (chosen.chi - freedom) / std::sqrt(2 * std::max(1.0, freedom));
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Sight& s : sights) {
      spread += (s.rotation - sights.front().rotation).cwiseAbs();
    }
    line.decidable = spread.maxCoeff() > 0.5 && std::abs(line.lab_over_sensor_nats) > 3;
    search.lines.push_back(line);
    taken.push_back(f);
    taken.push_back(bundle.rate_hz / 2 - std::abs(bundle.rate_hz / 2 - f));
  }
  std::sort(search.lines.begin(), search.lines.end(),
            [](const SpectralLine& a, const SpectralLine& b) { return a.gain_nats > b.gain_nats; });
  return search;
}

}  // namespace sixpoint::gap
