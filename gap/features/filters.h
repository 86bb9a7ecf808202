// The filters between what moves a unit and what it stores: low-pass and resonance, and their
// gains.
//
//   const double at_corner = low_pass_gain(25, 25, 4, 100);  // 0.71: order 4, corner 25 Hz, 100 Hz
#pragma once

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

// |H|, of a Butterworth low-pass designed by the bilinear transform.
double low_pass_gain(double frequency_hz, double corner_hz, int order, double rate_hz);
double resonance_gain(double frequency_hz, const Resonance& resonance);

}  // namespace sixpoint::gap
