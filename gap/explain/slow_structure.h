// Whether slow scatter has the structure of a sensor's own noise.
//
//   const SlowStructure structure = slow_structure(blocks, explanation.best(), slow, lsb_mg);
//   if (structure.other_nats > 0) {
//     std::cout << structure.other << " is likelier than the sensor's noise\n";
//   }
//
// random_walk and flicker can explain anything slow: an oscillating zero, a supply that couples in,
// growing play. Such causes move several axes together, or one alone, or in jumps. Noise of the
// sensor is independent from axis to axis, about equal in all, and Gaussian. Each of the three is a
// hypothesis with its own evidence.
#pragma once

#include <string>
#include <vector>

#include "gap/explain/blocks.h"
#include "gap/explain/evidence.h"
#include "gap/features/slow_noise.h"

namespace sixpoint::gap {

struct SlowStructure {
  // Log odds of the likeliest other cause over the noise that was found; priors included.
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
