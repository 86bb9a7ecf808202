#include "gap/features/filters.h"

#include <algorithm>
#include <cmath>
#include <complex>

namespace sixpoint::gap {

double low_pass_gain(double frequency_hz, double corner_hz, int order, double rate_hz) {
  const double f = std::min(frequency_hz, 0.499 * rate_hz);
  const double r = std::tan(M_PI * f / rate_hz) / std::tan(M_PI * corner_hz / rate_hz);
  return 1 / std::sqrt(1 + std::pow(r, 2 * order));
}

double LowPass::tone_gain(double frequency_hz, double rate_hz) const {
  if (form == LowPassForm::sampled) {
    return low_pass_gain(frequency_hz, corner_hz, order, rate_hz);
  }
  return 1 / std::sqrt(1 + std::pow(frequency_hz / corner_hz, 2 * order));
}

double LowPass::noise_gain(double frequency_hz, double rate_hz) const {
  if (form != LowPassForm::analogue) {
    return low_pass_gain(frequency_hz, corner_hz, order, rate_hz);
  }
  const auto power = [&](double f) { return 1 / (1 + std::pow(f / corner_hz, 2 * order)); };
  return std::sqrt(power(frequency_hz) + power(rate_hz - frequency_hz) +
                   power(rate_hz + frequency_hz));
}

double resonance_gain(double frequency_hz, const Resonance& resonance) {
  const double r = frequency_hz / resonance.frequency_hz;
  if (resonance.form == ResonanceForm::peak) {
    return 1 + (resonance.q - 1) / (1 + std::pow(2 * resonance.q * (r - 1), 2));
  }
  const std::complex<double> damping(0, r / resonance.q);
  const std::complex<double> below = 1 - r * r + damping;
  return std::abs(
      (resonance.form == ResonanceForm::base_excited ? 1.0 + damping : std::complex<double>(1)) /
      below);
}

}  // namespace sixpoint::gap
