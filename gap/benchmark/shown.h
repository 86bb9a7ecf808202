// What a recording shows of an effect at best: for the labels of a benchmark, without a diagnosis.
//
//   SIXPOINT_ASSIGN(const sim::ProtocolRecord without, sim::record_protocol(nominal));
//   SIXPOINT_ASSIGN(const sim::ProtocolRecord with, sim::record_protocol(faulty));
//   const Shown shown = what_is_shown(nominal, without, with);  // the same seed: the same noise
//   shown.index() / kShownAt;  // size over the bound: at 1 it is shown half of the time
//
// The detection index of a known signal in Gaussian noise, d^2 = s' C^-1 s (Kay, "Fundamentals of
// Statistical Signal Processing II: Detection Theory", 1998, 4.3): a matched filter that alarms
// at 3 standard deviations shows an effect of index 3 half of the time. The signal is the
// difference of two simulations of one seed. It consists of
//     means:   of each segment, and of its pieces of 10 s about that mean, in the noise of the
//              samples. What rounding scatters is measured and subtracted
//     samples: those that differ from their piece's mean by more than 1.25 counts, which no steady
//              change does however it is rounded
// these two beyond what one gain (2 %) and one offset (35 mg) of the unit take, per axis, and the seat
// of each placement (0.01 degrees about each axis), which turns gravity and what the shaker moves; and
//     times:   of the packets, within their segment, in the 2 ms (uniform) of the host's stamps
// Nothing else is unknown: the other effects are not free, and a random effect is taken as if its
// course were known. A method can hardly do better. Changes of single counts (the lowest bit, the
// way of rounding) are taken for not shown.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "sim/protocol_run.h"

namespace sixpoint::gap {

inline constexpr double kShownAt = 3;  // standard deviations; convention
// Standard deviation of a mean from placement to placement, across a force of 1 g, if nothing else is
// known (docs/gap.md).
inline constexpr double kSeating_mg = 0.17;

struct Shown {
  double means = 0, samples = 0, times = 0;                // squares
  std::map<std::pair<int, std::string>, double> by_place;  // squares, per axis and segment's name
  double index() const;
};

// `nominal`: rate, scale, noise and segments. The records must be of the same segments.
Shown what_is_shown(const sim::ProtocolRun& nominal, const sim::ProtocolRecord& without,
                    const sim::ProtocolRecord& with);

}  // namespace sixpoint::gap
