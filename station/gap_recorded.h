// Semi-synthetic trials: a known effect added to what a real unit recorded.
//
// The recording's own noise, gains, seating and whatever else is wrong with it stay; the effect
// acts on top of it, through the same hooks as in sim/. Counts get back the fraction that rounding
// took (uniform within half a count) before they are changed and rounded again, which adds a sixth
// of a squared count to their variance. Bundles at rest only: the phase of a recorded tone is not
// known.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/env.h"
#include "sim/effect.h"

namespace sixpoint::station {

// Effects that act on values, not on the times of samples, and that rest shows.
const std::vector<std::string>& effects_for_recordings();

// Writes the bundle `from`, with the effects, as the bundle `to`. bad_data as read_bundle; usage
// where the bundle holds a vibration.
Status write_recorded_trial(FileSystem& files, const std::string& from, const std::string& to,
                            const std::vector<sim::EffectSpec>& effects, std::uint64_t seed);

}  // namespace sixpoint::station
