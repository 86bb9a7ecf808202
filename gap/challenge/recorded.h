// Semi-synthetic trials: a known effect added to what a real unit recorded.
//
//   SIXPOINT_ASSIGN(const sim::EffectKind* const kind, sim::find_effect("tilt"));
//   SIXPOINT_ASSIGN(const auto values, sim::complete_parameters(*kind, {}));  // its defaults
//   SIXPOINT_CHECK(write_recorded_trial(files, "bundle", "trial", {{kind, values}}, seed));
//
// The recording's own noise, gains, seating and whatever else is wrong with it stay; the effect
// acts on top of it, through the same hooks as in sim/. Counts get back the fraction that rounding
// took (uniform within half a count) before they are changed and rounded again, which adds a sixth
// of a squared count to their variance. Bundles at rest only: the phase of a recorded tone is not
// known.
//
// A plain recording (.gt3x) can be given a filter mismatch: its raw counts are found again by its
// own constants and scaled as if the sensor had run under the other configuration. They are exact
// where the constants give at most 256 LSB/g; above, two raw counts share a stored count and one
// count may be off (calib/scaling.h). Header and all other records stay, as they do in real units.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/env.h"
#include "sim/effects/effect.h"

namespace sixpoint::gap {

// Effects that act on values, not on the times of samples, and that rest shows.
const std::vector<std::string>& effects_for_recordings();
// Those of a plain recording: what it can be diagnosed for without a protocol.
const std::vector<std::string>& effects_for_plain_recordings();

// Writes the bundle `from`, with the effects, as the bundle `to`. bad_data as read_bundle; usage
// where the bundle holds a vibration.
Status write_recorded_trial(FileSystem& files, const std::string& from, const std::string& to,
                            const std::vector<sim::EffectSpec>& effects, std::uint64_t seed);

// Writes the recording `from`, with the effects (`filter_mismatch` once, or none), as the file
// `to`. bad_data as repair::survey(), and where its constants can't be used or it was repaired;
// usage for another effect.
Status write_plain_trial(FileSystem& files, const std::string& from, const std::string& to,
                         const std::vector<sim::EffectSpec>& effects);

}  // namespace sixpoint::gap
