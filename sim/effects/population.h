// What units have in common and how they differ: effects with a mean and a spread between units.
//
//   SIXPOINT_ASSIGN(const Scenario scenario, parse_scenario(json));
//   const std::vector<EffectSpec> unit = draw_effects(scenario.population, 7);
//   const std::vector<EffectSpec> average = mean_effects(scenario.population);
//
// A population stands in a scenario under `population` (docs/scenario.md); `sixpoint gap adopt`
// writes it. Plain data.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/effects/effect.h"

namespace sixpoint::sim {

struct PopulationEffect {
  const EffectKind* kind = nullptr;
  ParameterSet mean;    // complete
  ParameterSet spread;  // standard deviation between units, as many numbers; 0 where not known
  double share_of_units = 1;
};

// The effects of one unit. Each number is normal about the mean; one whose plausible range has no
// negative numbers stays within that range, or at the mean where the mean is outside. An effect
// that `share_of_units` of the units have is there with that probability. The same seed gives the
// same unit, and what is drawn of one effect does not depend on which others there are.
std::vector<EffectSpec> draw_effects(const std::vector<PopulationEffect>& population,
                                     std::uint64_t unit_seed);

// Those of the average unit: effects that at least half of the units have, at their means.
std::vector<EffectSpec> mean_effects(const std::vector<PopulationEffect>& population);

}  // namespace sixpoint::sim
