#include "gap/features/line_scan.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace sixpoint::gap {
namespace {

using Complex = std::complex<double>;
using Vector3c = Eigen::Vector3cd;

constexpr double kTwoFrames_nats = std::numbers::ln2;  // laboratory and sensor were tried

// Shape, scale and shift of a gamma law that fits the largest eigenvalue: Chiani (2014), beta = 2.
constexpr double kChianiShape = 79.6595;
constexpr double kChianiScale = 0.101037;
constexpr double kChianiShift = 9.81961;

// log of the upper tail of a gamma law of shape m, scale 1 (Chernoff's bound, exact enough here).
double log_tail(double x, double m) { return x <= m ? 0 : -(x - m - m * std::log(x / m)); }

double eigenvalue_nats(double largest, std::size_t stretches) {
  if (stretches == 1) {
    return -log_tail(largest, 3);  // all power is in one direction
  }
  const double n = std::sqrt(static_cast<double>(stretches));
  const double m = std::sqrt(3.0);
  const double centre = (n + m) * (n + m);
  const double width = (n + m) * std::cbrt(1 / n + 1 / m);
  return -log_tail(((largest - centre) / width + kChianiShift) / kChianiScale, kChianiShape);
}

// Spectra of the three axes, padded with zeros to `length`.
class Spectra {
 public:
  explicit Spectra(std::size_t length) : length_(length) {}
  void transform(const Stretch& stretch) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      padded_ = stretch.x[axis];
      padded_.resize(length_, 0);
      fft_.fwd(spectrum_[axis], padded_);
    }
  }
  Vector3c at(std::size_t k, const Eigen::Vector3d& weight) const {
    return {spectrum_[0][k] * weight[0], spectrum_[1][k] * weight[1], spectrum_[2][k] * weight[2]};
  }

 private:
  std::size_t length_;
  Eigen::FFT<double> fft_;
  std::vector<double> padded_;
  std::array<std::vector<Complex>, 3> spectrum_;
};

// The noise's sd at each of `half` frequencies; from a coarse grid: noise is smooth.
std::vector<Eigen::Vector3d> noise_sd(const NoiseSpectrum& noise, double rate_hz,
                                      std::size_t half) {
  constexpr std::size_t kCoarse = 400;
  std::vector<Eigen::Vector3d> grid(kCoarse + 1);
  for (std::size_t k = 0; k <= kCoarse; ++k) {
    const double f = 0.5 * rate_hz * static_cast<double>(k) / kCoarse;
    grid[k] = noise.variances_at(f);
  }
  std::vector<Eigen::Vector3d> sd(half);
  for (std::size_t k = 0; k < half; ++k) {
    sd[k] = grid[k * kCoarse / half].cwiseSqrt();
  }
  return sd;
}

// Of a Hermitian matrix whose eigenvalues sum to three per stretch where there is noise alone. The
// trace bounds the eigenvalue: most bins need no decomposition.
double largest_eigenvalue(const Eigen::Matrix3cd& m, std::size_t stretches) {
  const double trace = m.trace().real();
  if (trace < 3.0 * static_cast<double>(stretches)) {
    return trace / 3;
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3cd> solver;
  solver.computeDirect(m, Eigen::EigenvaluesOnly);
  return solver.eigenvalues()[2];
}

// Inverse covariances of the coherent sum at one frequency.
struct SumCovariance {
  Eigen::Matrix3d lab = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d sensor = Eigen::Matrix3d::Zero();
};

SumCovariance sum_covariance(const std::vector<const Stretch*>& set,
                             const Eigen::Vector3d& weight) {
  SumCovariance sum;
  const Eigen::Matrix3d white = weight.asDiagonal();
  for (const Stretch* s : set) {
    const Eigen::Matrix3d& r = s->rotation;
    sum.sensor += static_cast<double>(s->known) * white;
    sum.lab += static_cast<double>(s->known) * (r.transpose() * white * r);
  }
  return {sum.lab.inverse(), sum.sensor.inverse()};
}

}  // namespace

LineScan scan_powers(double rate_hz, const std::vector<const Stretch*>& set,
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
  out.step_hz = rate_hz / static_cast<double>(length);
  out.nats.assign(half, 0);
  const std::vector<Eigen::Vector3d> level = noise_sd(noise, rate_hz, half);
  Spectra spectra(length);
  const bool one = set.size() == 1;
  out.stretches = set.size();
  std::vector<Eigen::Matrix3cd> lab(one ? 0 : half, Eigen::Matrix3cd::Zero());
  std::vector<Eigen::Matrix3cd> sensor(one ? 0 : half, Eigen::Matrix3cd::Zero());
  for (const Stretch* s : set) {
    out.samples += static_cast<double>(s->known);
    spectra.transform(*s);
    const double scale = 1 / std::sqrt(static_cast<double>(s->known));
    const Eigen::Matrix3cd back = s->rotation.transpose().cast<Complex>();
    for (std::size_t k = 0; k < half; ++k) {
      Vector3c z = spectra.at(k, scale / level[k].array());
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
    const double most =
        std::max(largest_eigenvalue(lab[k], set.size()), largest_eigenvalue(sensor[k], set.size()));
    out.nats[k] = eigenvalue_nats(most, set.size()) - kTwoFrames_nats;
  }
  return out;
}

LineScan scan_in_step(double rate_hz, const std::vector<Stretch>& all, const NoiseSpectrum& noise) {
  constexpr double kLongest_s = 900;  // a host's clock keeps the phase of a line that long
  constexpr std::size_t kFewest = 4;
  constexpr std::size_t kCoarse = 64;  // bins of one noise level
  LineScan out;
  std::vector<const Stretch*> near;
  double first_s = 0;
  for (const Stretch& s : all) {
    const double t = s.start_s;
    first_s = near.empty() ? t : first_s;
    if (t - first_s < kLongest_s) {
      near.push_back(&s);
    }
  }
  if (near.size() < kFewest) {
    return out;
  }
  const double span_s = near.back()->start_s - first_s + 10;
  std::size_t length = 1024;
  while (static_cast<double>(length) < 1.5 * span_s * rate_hz) {
    length *= 2;
  }
  const std::size_t half = length / 2;
  out.step_hz = rate_hz / static_cast<double>(length);
  out.nats.assign(half, 0);
  std::vector<Eigen::Vector3d> weight;  // 1 / variance
  for (std::size_t k = 0; k < half; k += kCoarse) {
    const std::size_t middle = k + kCoarse / 2;
    const double f = static_cast<double>(middle) * out.step_hz;
    weight.push_back(noise.variances_at(f).cwiseInverse());
  }
  std::vector<Vector3c> lab(half, Vector3c::Zero());
  std::vector<Vector3c> sensor(half, Vector3c::Zero());
  Spectra spectra(length);
  out.stretches = 1;  // as good as: all have one phase
  for (const Stretch* s : near) {
    out.samples += static_cast<double>(s->known);
    spectra.transform(*s);
    const Eigen::Matrix3cd back = s->rotation.transpose().cast<Complex>();
    const Complex turn = std::polar(1.0, -2 * M_PI * out.step_hz * (s->start_s - first_s));
    Complex phase = 1;
    for (std::size_t k = 0; k < half; ++k) {
      const Vector3c z = phase * spectra.at(k, weight[k / kCoarse]);
      sensor[k] += z;
      lab[k] += back * z;
      phase *= turn;
    }
  }
  const auto power = [](const Vector3c& b, const Eigen::Matrix3d& inverse) {
    return b.real().dot(inverse * b.real()) + b.imag().dot(inverse * b.imag());
  };
  SumCovariance inverse;
  for (std::size_t k = 0; k < half; ++k) {
    if (k % kCoarse == 0) {
      inverse = sum_covariance(near, weight[k / kCoarse]);
    }
    out.nats[k] =
        -log_tail(std::max(power(sensor[k], inverse.sensor), power(lab[k], inverse.lab)), 3) -
        kTwoFrames_nats;
  }
  return out;
}

double shown_line_mg(const LineScan& scan, double nats, const Eigen::Vector3d& noise_mg2) {
  constexpr double kBetweenBins = 0.95;  // of the power, on average: half-bin steps
  constexpr double kMostRatio = 1e6;
  const auto m = static_cast<double>(scan.stretches);
  // `signal`: of the line's power over the noise's, summed over the stretches.
  const auto shown_nats = [&](double signal) {
    const double largest =
        scan.stretches == 1 ? signal + 3 : (m + signal) * (1 + 3 / std::max(signal, 1e-9));
    return eigenvalue_nats(largest, scan.stretches) - kTwoFrames_nats;
  };
  double low = std::sqrt(3 * m), high = kMostRatio * low;  // below it no direction stands out
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = std::sqrt(low * high);
    (shown_nats(middle) < nats ? low : high) = middle;
  }
  const double per_mg2 = kBetweenBins * scan.samples / 4 * noise_mg2.cwiseInverse().mean();
  return std::sqrt(high / per_mg2);
}

}  // namespace sixpoint::gap
