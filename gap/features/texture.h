// Whether the noise of what lies still is one stationary Gaussian process: at seven time scales,
// in every dwell, at every moment.
//
//   const Texture texture = noise_texture(bundle, clean);
//   for (const Texture::Scale& scale : texture.scales) {
//     const bool gaussian = std::abs(scale.tails_sd) < kAlarm_sd;
//   }
//
// Differences between the means of neighbouring stretches (Haar's wavelets) of 1 to 64 samples.
// Whatever filter stands behind Gaussian noise, each scale's are Gaussian, of one variance in all
// dwells and at all times; only their correlation is the filter's, and it is measured. Knocks,
// spells of louder noise, machines that come and go, what follows moves, and anything that is not
// linear are not like that. No form of theirs is assumed.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

struct Texture {
  // All in standard deviations of a normal variable.
  struct Scale {
    std::size_t samples = 0;   // of one stretch; 0: 1 to 8 together
    double tails_sd = 0;       // excess kurtosis, signed
    double sd_per_excess = 0;  // what an excess of one would be
    double dwells_sd = 0;      // variances from dwell to dwell (pieces of ten seconds)
    double moments_sd = 0;     // energies of all axes from moment to moment (1.28 s)
    double loudest_sd = 0;     // the loudest moment, their number allowed for
    std::size_t loudest_segment = 0;
    double after_moves_sd = 0;  // energy of the first seconds after moves against the rest
  };
  std::vector<Scale> scales;
};

// Scales at which rounding to whole counts would show are left out. Lines at these frequencies are
// taken off first, from each dwell by its own amplitude and phase, and dwells in which the clock
// slips are left out then. `ringing`: the deviation at `t` seconds after a move, as a share of its
// step (StepResponse::model), which is taken off, too. `quiet_s`: so much after a move is left out.
Texture noise_texture(const Bundle& bundle, const CleanSamples& clean,
                      const std::vector<double>& lines_hz = {},
                      const std::function<double(double t_s)>& ringing = {}, double quiet_s = 0);

}  // namespace sixpoint::gap
