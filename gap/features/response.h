// Amplitude response over frequency: the shape of the noise's spectrum and of the tones.
//
// A lower anti-alias corner acts on signal and noise alike; a soft mount acts on the shaker's tones
// only. Both are fitted on grids: Butterworth low-passes of order 1 to 8, sampled or analogue, and
// three forms of a resonance (base excitation of a damped mount, a plain second-order section, a
// peak upon a flat response).
#pragma once

#include <array>
#include <vector>

#include "gap/bundle.h"
#include "gap/features/noise.h"
#include "gap/features/tones.h"

namespace sixpoint::gap {

// How the filter was made: as a sampled filter (bilinear transform); in front of the sampler, as
// the tones see it, while the noise is the sampled filter's; in front of the sampler altogether,
// what lies beyond half the rate folded back into the noise.
enum class LowPassForm { sampled, mixed, analogue };

struct LowPass {
  double corner_hz = 0;
  double corner_sd_hz = 0;
  int order = 0;
  double noise_nats = 0;  // over flat noise
  double tone_nats = 0;   // over flat tones
  LowPassForm form = LowPassForm::sampled;
  // Log predictive likelihood over flat: tones of frequencies that were left out; without tones the
  // noise of one axis, from the corner that the other two show.
  double held_out_nats = 0;

  // |H| of tones and of noise.
  double tone_gain(double frequency_hz, double rate_hz) const;
  double noise_gain(double frequency_hz, double rate_hz) const;
};

enum class ResonanceForm { base_excited, second_order, peak };

struct Resonance {
  double frequency_hz = 0;
  double q = 0;
  ResonanceForm form = ResonanceForm::base_excited;
  double tone_nats = 0;
  double held_out_nats = 0;  // as above
};

struct Response {
  LowPass low_pass;     // the best of its kind, whether wanted or not
  Resonance resonance;  // best on top of the low-pass where that is significant
  bool has_tones = false;
  // Per order: ratio of noise at the highest quarter of the band to the lowest, all axes.
  double noise_flat_sd = 0;  // chi-square of flat noise, in sd
  double noise_left_sd = 0;  // ... of the low-pass, without 1/f noise
  double tone_flat_sd = 0;   // chi-square of flat tones
  double tone_left_sd = 0;   // ... less what is significant of low-pass and resonance
  double tone_flat_chi = 0;
  double tone_left_chi = 0;  // of the best resonance, whether it is accepted or not
  bool low_pass_significant = false;
  bool resonance_significant = false;
  // What is left of the tones' amplitudes beyond noise, as a share: how well the form is known.
  double tone_form_share = 0;
  std::array<double, 3> white_mg{};  // of one sample before rounding and filter
  // 1/f noise beside the white, root of its one-sided density at 1 Hz; 0 where none is needed. It
  // and a low-pass bend the spectrum alike, so that both are tried together.
  double pink_mg = 0;

  // |H| of a tone and of noise by what is significant; 1 where nothing is.
  double tone_gain(double frequency_hz, double rate_hz) const;
  double noise_gain(double frequency_hz, double rate_hz) const;
};

// |H|, of a Butterworth low-pass designed by the bilinear transform.
double low_pass_gain(double frequency_hz, double corner_hz, int order, double rate_hz);
double resonance_gain(double frequency_hz, const Resonance& resonance);

struct ResponseOptions {
  bool allow_low_pass = true;
  bool allow_resonance = true;
  std::vector<double> lines_hz;  // spectral lines: bins beside them are left out
};

Response find_response(const Bundle& bundle, const NoiseSpectrum& noise,
                       const std::vector<ToneFit>& tones, const ResponseOptions& options);

}  // namespace sixpoint::gap
