// Whether slow scatter has the structure of a sensor's own noise.
//
// random_walk and flicker absorb whatever is slow: a swinging zero, a supply that couples in, play
// that grows. Those move several axes in step, or one alone, or jump; noise of the sensor is
// independent from axis to axis, about alike in all, and Gaussian. Each of the three is a
// hypothesis with an evidence of its own, and competes with the noise that would be named.
#pragma once

#include <string>
#include <vector>

#include "gap/blocks.h"
#include "gap/evidence.h"
#include "gap/features/slow_noise.h"

namespace sixpoint::gap {

struct SlowStructure {
  // Log odds of the likeliest other thing over the noise that was found; priors included.
  double other_nats = -1e3;
  std::string other;  // in words
  // The three evidences, without priors: axes in step, axes unlike, jumps.
  double in_step_nats = 0;
  double unlike_nats = 0;
  double jump_nats = 0;
};

// `fit` holds random_walk or flicker as its scatter.
SlowStructure slow_structure(const std::vector<Block>& blocks, const Fit& fit,
                             const SlowNoise& records, double lsb_mg);

}  // namespace sixpoint::gap
