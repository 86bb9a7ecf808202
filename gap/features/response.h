// Amplitude response over frequency: the shape of the noise's spectrum and of the tones.
//
//   const Response response = find_response(bundle, noise, tones, ResponseOptions{});
//   if (response.low_pass_significant) {
//     const double corner_hz = response.low_pass.corner_hz;
//   }
//
// A lower anti-alias corner acts on signal and noise alike; a soft mount acts on the shaker's tones
// only. Both are fitted on grids: Butterworth low-passes of order 1 to 8, sampled or analogue, and
// three forms of a resonance (base excitation of a damped mount, a plain second-order section, a
// peak upon a flat response).
#pragma once

#include <array>
#include <vector>

#include "gap/features/filters.h"
#include "gap/features/noise.h"
#include "gap/features/tones.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

struct Response {
  LowPass low_pass;     // the best of its kind, whether wanted or not
  Resonance resonance;  // best on top of the low-pass where that is significant
  bool has_tones = false;
  double noise_flat_sd = 0;  // chi-square of flat noise, in sd
  double noise_left_sd = 0;  // ... of the low-pass, without 1/f noise
  double tone_left_sd = 0;   // ... of tones, less what is significant of low-pass and resonance
  bool low_pass_significant = false;
  bool resonance_significant = false;
  // What shows half of the time: corners of an order of four, and mounts of a q of 2.5 (the
  // catalogue's), up to these frequencies. 0: none does.
  double bound_corner_hz = 0;
  double bound_mount_hz = 0;
  // What is left of the tones' amplitudes beyond noise, as a share: how well the form is known.
  double tone_form_share = 0;
  std::array<double, 3> white_mg{};  // of one sample before rounding and filter

  // |H| of a tone and of noise by what is significant; 1 where nothing is. The mount stands before
  // the sensor, the filter behind it: what is curved in the sensor sees a tone that is not
  // filtered.
  double mount_gain(double frequency_hz) const {
    return resonance_significant ? resonance_gain(frequency_hz, resonance) : 1;
  }
  double filter_gain(double frequency_hz, double rate_hz) const {
    return low_pass_significant ? low_pass.tone_gain(frequency_hz, rate_hz) : 1;
  }
  double tone_gain(double frequency_hz, double rate_hz) const {
    return filter_gain(frequency_hz, rate_hz) * mount_gain(frequency_hz);
  }
  double noise_gain(double frequency_hz, double rate_hz) const {
    return low_pass_significant ? low_pass.noise_gain(frequency_hz, rate_hz) : 1;
  }
  // How many samples of the filtered noise count for one in a mean square: the sum of their squared
  // correlations (Bartlett 1946), by Parseval the mean of |H|^4 over the squared mean of |H|^2.
  double correlated_samples(double rate_hz) const;
};

struct ResponseOptions {
  bool allow_low_pass = true;
  bool allow_resonance = true;
  std::vector<double> lines_hz;  // spectral lines: bins beside them are left out
  double named_from_nats = 0;    // evidence from which on what is significant is named, too
};

Response find_response(const Bundle& bundle, const NoiseSpectrum& noise,
                       const std::vector<ToneFit>& tones, const ResponseOptions& options);

}  // namespace sixpoint::gap
