// Numbers that decide an answer and that more than one step of the diagnosis uses.
//
//   const bool accepted = nats > kAccept_nats;
//
// Unit: nats (natural logarithm of odds or of a likelihood ratio). Source: conventions, which
// docs/gap.md lists, if nothing else is said.
#pragma once

#include <array>
#include <cstddef>

namespace sixpoint::gap {

// Prior log odds of one effect: the catalogue has thirty, and one of them is present.
inline constexpr double kLogPriorEffect = -3.5;
// One unit in ten is a real one that shows a little of everything: each effect is there with even
// odds. The others have at most a fault or two.
inline constexpr double kShareOfRealUnits = 0.1;
// Prior log odds of one kind of cause that the catalogue lacks: a third of the above.
inline constexpr double kLogPriorUnknown = -4.5;
// An effect is accepted from nine to one on: log 9.
inline constexpr double kAccept_nats = 2.2;
// Beside kManyEffects others the unit is a real one that has a little of everything: then what is
// likelier than not, which leaves 0.97 and more of all names right (docs/gap.md).
inline constexpr double kAcceptAmongMany_nats = 0;
inline constexpr std::size_t kManyEffects = 4;
// An unknown cause takes the place of a named one from twenty to one on: log 20.
inline constexpr double kUnknownWins_nats = 3;
// Log odds of something that was not asked for.
inline constexpr double kExcluded_nats = -1e3;

// Real effects bend from the catalogue's plain laws by up to a tenth: the standard uncertainty of a
// size that was estimated by the plain law.
inline constexpr double kFormShare = 0.05;

// A test of the residuals alarms at this many standard deviations. About forty tests of normal
// variables would alarm in less than one bundle in a million; the real tails (chi-square with few
// dwells) are heavier, and `gap challenge --none 1` counts 0 in 300.
inline constexpr double kAlarm_sd = 5.5;

// The nominal unit: noise of one sample at 100 Hz per axis (its density is the same at every rate,
// so at another one it is that times the root of the rates' ratio), and the spread of gains and
// offsets from unit to unit (ADXL362 datasheet, typical values).
inline constexpr std::array<double, 3> kNominalNoise_mg = {3.9, 3.9, 5.5};
inline constexpr double kNominalNoiseAt_hz = 100;
inline constexpr double kGainSd = 0.02;
inline constexpr double kOffsetSd_mg = 35;

}  // namespace sixpoint::gap
