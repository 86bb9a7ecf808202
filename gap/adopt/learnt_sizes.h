// The population of a scenario as what the next diagnosis expects of a unit.
//
//   SIXPOINT_ASSIGN(const std::vector<LearntSize> learnt, learnt_sizes(scenario_text));
//   const auto diagnosis = diagnose(bundle, {.learnt = learnt});
//
// What the next unit has is uncertain by the spread between units and by the mean's own
// uncertainty: the square root of the sum of their squares. From few units both are known badly;
// then it is widened to the standard deviation of Student's t of units - 1 degrees of freedom.
#pragma once

#include <string_view>
#include <vector>

#include "base/result.h"
#include "gap/explain/learnt_size.h"

namespace sixpoint::gap {

struct LearntSizesOptions {
  // Units are not more alike than a twentieth of the catalogue's typical size: what was learnt is
  // from another day and another protocol, and an effect bends from its law by as much.
  double least_share_of_typical = 0.05;
  // In the place of Student's t, which has no standard deviation for two units and three.
  double widened_for_few = 3;
};

// By name. Effects of the population that the means of dwells and tones do not show (clock, lines,
// scatter ...) are left out, and so is what one unit alone had, or whose spread is null: it says
// nothing of the next. An entry without `units`, written by hand, is taken at its word. Empty where
// nothing was adopted.
// configuration where this is no scenario, or has no `population`.
Result<std::vector<LearntSize>> learnt_sizes(std::string_view scenario,
                                             const LearntSizesOptions& options = {});

}  // namespace sixpoint::gap
