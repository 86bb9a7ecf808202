// The gap between a recording and a simulator that is not the nominal one: what is left when the
// simulator has effects switched on.
//
//   // What the simulator stores in the bundle's protocol, with effects and without, same noise:
//   const std::vector<gt3x::Counts> with = bundle.samples, without = bundle.samples;
//   SIXPOINT_ASSIGN(const GapAgainst left, gap_against(bundle, with, without));
//   std::cout << left.gap_mg << " mg, of which noise and seating are " << left.floor_mg << '\n';
//
// Means of dwells and amplitudes of small tones are taken from all three in one way, with nothing
// undone but marks that noise cannot make. What the effects do to them in the simulation is taken
// off the recording's, and measure_gap() says what the nominal unit leaves of that, held out by
// condition as in `gap.before` of a diagnosis. Noise that both simulations share goes out of their
// difference. Phases of tones, lines, ringing and slips do not count here: they average out.
#pragma once

#include <vector>

#include "gap/judge/diagnosis.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

struct GapAgainst {
  double gap_mg = 0;    // root mean square per axis and mean
  double floor_mg = 0;  // of noise and seating
  double sigma = 0;     // the gap in standard deviations of noise and seating
  int rows = 0;         // numbers that were compared
  // Gains and offsets that are left: of the unit, and of a wrong acquisition mode.
  UnitEstimate unit;
};

// `with` and `without`: one sample for each of the recording's. bad_data where they are not, or
// where no dwell of the recording can be compared.
Result<GapAgainst> gap_against(const Bundle& recorded, const std::vector<gt3x::Counts>& with,
                               const std::vector<gt3x::Counts>& without);

}  // namespace sixpoint::gap
