// Semi-synthetic trials: a known effect added to what a real unit recorded.
//
// The recording's own noise, gains, seating and whatever else is wrong with it stay; the effect
// acts on top of it, through the same hooks as in sim/. Counts get back the fraction that rounding
// took (uniform within half a count) before they are changed and rounded again, which adds a sixth
// of a squared count to their variance. Bundles at rest only: the phase of a recorded tone is not
// known.
//
// A plain recording (.gt3x) can be given a filter mismatch: its raw counts are found again by its
// own constants, exactly, and scaled as if the sensor had run under the other configuration. Header
// and all other records stay, as they do in real units.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/env.h"
#include "sim/effect.h"

namespace sixpoint::station {

// Effects that act on values, not on the times of samples, and that rest shows.
const std::vector<std::string>& effects_for_recordings();
// Those of a plain recording: what it can be diagnosed for without a protocol.
const std::vector<std::string>& effects_for_plain_recordings();

// Writes the bundle `from`, with the effects, as the bundle `to`. bad_data as read_bundle; usage
// where the bundle holds a vibration.
Status write_recorded_trial(FileSystem& files, const std::string& from, const std::string& to,
                            const std::vector<sim::EffectSpec>& effects, std::uint64_t seed);

// Writes the recording `from`, with the effects (`filter_mismatch` once, or none), as the file
// `to`. bad_data as repair::survey(), and where its constants can't be used or it was mended; usage
// for another effect.
Status write_plain_trial(FileSystem& files, const std::string& from, const std::string& to,
                         const std::vector<sim::EffectSpec>& effects);

}  // namespace sixpoint::station
