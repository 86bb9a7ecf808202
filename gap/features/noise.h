// The unit's noise: its spectrum, its spread from dwell to dwell, and what its numbers look like.
//
//   const NoiseSpectrum noise = noise_spectrum(bundle, clean);
//   const double white_x_mg = noise.white_mg[0];  // sd of one sample
//   const CodeStatistics codes = code_statistics(bundle, clean);
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

// Mean periodogram (Hann window, blocks of 2 s, mean removed) over everything that lies still,
// without blocks in which the clock slips where others are enough, as equivalent white variance:
// white noise of variance s^2 has the value s^2 in every bin.
struct NoiseSpectrum {
  double step_hz = 0.5;
  std::size_t blocks = 0;
  std::vector<double> frequency_hz;                 // from 1.5 Hz to half the rate
  std::array<std::vector<double>, 3> variance_mg2;  // per axis and frequency
  std::array<double, 3> white_mg{};                 // sd of one sample, median over 1.5 to 8 Hz
  bool usable() const { return blocks >= 10; }
  double variance_at(std::size_t axis, double frequency_hz) const;
  Eigen::Vector3d variances_at(double at_hz) const {
    return {variance_at(0, at_hz), variance_at(1, at_hz), variance_at(2, at_hz)};
  }
};
NoiseSpectrum noise_spectrum(const Bundle& bundle, const CleanSamples& clean);

// Variance of a sample, rounding's own twelfth taken off, below which its distribution shows the
// grid of counts, LSB^2: of the cumulants of a rounded Gaussian value the grid's share is exp(-2
// pi^2 x 0.5), a few in 10^5 (Widrow and Kollar 2008, chapter 5). Units at 50 Hz and less are below
// it on x and y.
inline constexpr double kFreeOfGrid_lsb2 = 0.5;

// Numbers that should be plain: odd and even values alike, repeats no more often than chance, no
// value far out, equal noise in every dwell.
struct CodeStatistics {
  std::size_t samples = 0;
  std::array<double, 3> odd_share{};  // about 0.5
  std::array<double, 3> parity_sd{};  // of odd_share, by chance and by the means' grid
  // Samples equal to the one before on all axes: more than to the one seven before, in sd.
  double repeats_excess_sd = 0;
  std::size_t outliers = 0;  // beyond 6 sd of their dwell
  // Scatter of the dwells' variances against chance: chi-square per degree of freedom, in sd; and
  // the worst dwell.
  double spread_sd = 0;
  double spread_freedom = 0;
  std::size_t worst_segment = 0;
  double kurtosis_sd = 0;  // excess kurtosis over its standard deviation, of axes free of the grid
  // The code whose count is furthest from what Gaussian noise puts there, all dwells together.
  double code_sd = 0;
  std::size_t code_axis = 0;
  int code = 0;
  double cross_correlation_sd = 0;  // largest correlation between two axes' noise, in sd
};
CodeStatistics code_statistics(const Bundle& bundle, const CleanSamples& clean);

}  // namespace sixpoint::gap
