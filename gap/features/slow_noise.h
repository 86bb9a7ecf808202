// Noise slower than a second: 1/f and 1/f^2, from records that lie still at one temperature.
//
//   const SlowNoise slow = slow_noise(bundle, clean, noise);
//   const bool jumps = slow.jump_nats > 0;  // likelier than a random walk and 1/f noise
//
// Means over one second are turned by a cosine transform (DCT-II), which is the Karhunen-Loeve
// basis of a random walk less its mean: coefficient k has the variance q^2 / (4 sin^2(k pi / 2K)),
// white noise the same in all, and 1/f noise about F K / k. Coefficients are independent enough to
// multiply their likelihoods. Long records lose a parabola first, so that drift is not taken for
// noise.
#pragma once

#include <array>
#include <vector>

#include "gap/features/noise.h"
#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

struct SlowNoise {
  // Log likelihood over white noise alone on the grid walk x flicker.
  std::vector<double> walk_mg;            // mg per sqrt(s); first is 0
  std::vector<double> flicker_mg;         // first is 0
  std::vector<std::vector<double>> nats;  // [walk][flicker]
  // Of a spectrum free in every octave, over white noise alone, less two nats an octave.
  double free_nats = 0;
  // Power in the slow coefficients over that of the fast, in sd, at the best grid point: what is
  // left for something that neither explains.
  double misfit_sd = 0;
  // The same for the worst axis alone: a sensor's own slow noise is alike on all
  // axes.
  double axis_sd = 0;
  // Excess kurtosis of the differences between means of neighbouring 3 s and 8 s, the worst axis,
  // in sd. Walks and 1/f noise are Gaussian; a zero that jumps is not.
  double jump_sd = 0;
  // Log evidence, from records cut into pieces of ten seconds, of a zero that jumps now and then
  // over the better of a random walk and 1/f noise; sizes and rates unknown.
  double jump_nats = 0;

  // The coefficients, axis by axis: they show whether the axes move together.
  struct Mode {
    std::array<double, 3> value_mg{};
    std::array<double, 3> white_mg2{};
    double walk = 0;     // variance per (mg per sqrt(s))^2
    double flicker = 0;  // variance per mg^2/Hz at 1 Hz
  };
  std::vector<Mode> modes;

  struct Best {
    double walk_mg = 0;
    double flicker_mg = 0;
    double nats = 0;
  };
  Best best() const;
  // Evidence that these records are expected to have for 1/f noise of the size that is tried, in mg,
  // or for a walk in mg per sqrt(s), where it is there with another size.
  double expected_nats(bool flicker, double size, double tried) const;
};

// Power density at 1 Hz, one-sided, mg^2/Hz: `flicker_mg` is its square root, as in sim/effects.
double flicker_density_mg2(double flicker_mg);

SlowNoise slow_noise(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise);

}  // namespace sixpoint::gap
