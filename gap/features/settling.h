// The mean response to a pose change: every dwell's first seconds, weighted by the step it
// followed.
//
//   const StepResponse step = step_response(bundle, clean, noise);
//   if (step.usable) {
//     const double share = step.model(0.1);  // of the step, 0.1 s after the move
//   }
#pragma once

#include <functional>
#include <vector>

#include "gap/features/noise.h"
#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

struct StepResponse {
  bool usable = false;        // at least two steps of 0.2 g
  std::vector<double> share;  // per sample: deviation from the rest of the dwell, share of the step
  double sd = 0;              // of one sample of `share`
  // a exp(-t/decay) cos(2 pi f t + phase), the likeliest; where the mount has a second mode that
  // shows, both.
  struct Mode {
    double amplitude = 0;
    double amplitude_sd = 0;
    double frequency_hz = 0;
    double decay_s = 0;
    double phase_rad = 0;
    double at(double t_s) const;
  };
  Mode mode;             // the stronger
  Mode second;           // amplitude 0 where there is none
  double amplitude = 0;  // of the deviation just after the move, both modes, unsigned
  double gain_nats = 0;  // of the first mode, over nothing
  double model(double t_s) const { return mode.at(t_s) + second.at(t_s); }
  double plain_nats = 0;  // of the best a exp(-t/decay) without ringing, over nothing
  // Chi-square of `share` (first second) less the ringing, in sd over its mean.
  double left_sd = 0;
  double left_without_sd = 0;  // ... with nothing taken off
};

// `use`: which segments count (empty: all). `lines_hz`: spectral lines, which are fitted to the
// rest of each dwell and taken off.
StepResponse step_response(const Bundle& bundle, const CleanSamples& clean,
                           const NoiseSpectrum& noise, const std::vector<double>& lines_hz = {},
                           const std::function<bool(const Segment&)>& use = {});

// Log likelihood over nothing of dwells in one half of the poses, predicted from the ringing fitted
// to the other half; both halves added.
double held_out_step_nats(const Bundle& bundle, const CleanSamples& clean,
                          const NoiseSpectrum& noise, const std::vector<double>& lines_hz = {});

}  // namespace sixpoint::gap
