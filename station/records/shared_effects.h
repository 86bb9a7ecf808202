// The model of gap_trends.h: which jigs, faces, stations and lots move what the units read, by how
// much, and how probable that is.
//
//   const SharedEffects found = find_shared_effects(runs, sizes);
//   for (const ElementFinding& jig : found.skew.jigs) {
//     std::cout << jig.probability << ' ' << jig.size << '\n';
//   }
//
// Every reading is its unit's own value, the effects of its jig, station and lot, and the scatter
// of a placement (station/statistics/crossed_effects.h). An effect is there or it is exactly 0. In
// the order of their evidence those that are there are taken into the model, and taken out again
// where the others explain them; after each step the scatter of units and of placements is learnt
// anew. The evidence is the ratio of the readings' densities with and without the effect, all
// others as they are, averaged over its possible forms and sizes; the probability is that ratio
// times the odds beforehand (a spike and a slab; George and McCulloch 1993, JASA 88, 881). Odds and
// sizes are learnt: after a first pass each level's share of elements that have an effect, and what
// sizes they have, are those of the store, added to the prior of SharedEffectOptions as if it were
// ten elements.
//
// The twelve skew readings are taken apart into three groups of their own scatter:
//
//     turn (3)   the axes turned together: opposite sign on opposite faces, and between two axes
//     shear (3)  the axes not at right angles: opposite sign on opposite faces
//     even (6)   the same on opposite faces: no linear sensor does it, a tilted jig does
//
//     a tilted jig moves      turn alone (a nest that is turned); even alone, or all twelve (nests that
//                             lean); or what two angles say: a base that is not level under a unit
//                             that lies as the table of station/run/jig_run.h has it
//     a face of a jig moves   its own two readings
//     a station moves         as a jig, on all its jigs
//     a lot moves             turn alone, or turn and shear
//
// Sizes are averaged over the forms by their probabilities, and are root mean squares: a part that the
// readings hardly show adds its variance, so that it makes the size uncertain, not small.
//
// Pure functions; any thread. Probabilities take the learnt scatter for known.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "station/records/run_readings.h"
#include "station/statistics/crossed_effects.h"

namespace sixpoint::station {

// A run, with the numbers of its unit, jig, station and lot (from 0).
struct ModelRun {
  std::size_t unit = 0;
  std::size_t unit_and_filter = 0;  // zero and sensitivity are another's under another filter
  std::size_t filter = 0;
  std::size_t jig = 0;
  std::size_t station = 0;
  std::optional<std::size_t> lot;
  RunReadings readings;
};
struct ModelSizes {
  std::size_t units = 0;
  std::size_t units_and_filters = 0;
  std::size_t filters = 0;
  std::size_t jigs = 0;
  std::size_t stations = 0;
  std::size_t lots = 0;
};

// What is believed before the store has taught anything; medians of a wide prior.
struct SharedEffectOptions {
  // Skew is in orthonormal coordinates: a turn of 1 degree, read four times, is 2. ADXL362, data
  // sheet: 1 % cross-axis sensitivity, typical, is 0.6 degree, most of it a turn of the chip. A
  // good seat repeats to 0.01 degree; where runs hold repeats, theirs stands in its place.
  ScatterPrior turn_deg{{0.6, 0.01}};
  ScatterPrior shear_deg{{0.2, 0.01}};
  // Non-linearity moves opposite faces alike: a milli-g is 0.06 degree.
  ScatterPrior even_deg{{0.02, 0.01}};
  ScatterPrior zero_mg{{35, 1}};               // data sheet: 35 mg typical, x and y
  ScatterPrior sensitivity_percent{{3, 0.1}};  // data sheet: 10 % at most
  // Sizes that an effect may have, each component: what a workshop's level still shows, a tenth of
  // a millimetre under a nest of 40 mm, a jig that fell.
  std::array<double, 3> skew_sizes_deg{0.04, 0.14, 0.5};
  std::array<double, 3> zero_sizes_mg{3, 10, 35};
  std::array<double, 3> sensitivity_sizes_percent{0.2, 0.7, 2.5};
  // Shares of jigs, stations and lots that have an effect.
  double jig_share = 0.1;
  double station_share = 0.05;
  double lot_share = 0.1;
  double prior_elements = 10;    // that these shares are worth
  std::size_t fewest_units = 3;  // a lot of fewer is not asked for
};

struct FaceFinding {
  double probability = 0;
  double size = 0;  // degrees: how far the face leans
  double standard_uncertainty = 0;
};

enum class SharedLevel { jig, station, lot };
struct Rival {
  SharedLevel level = SharedLevel::lot;
  std::size_t index = 0;
};

struct ElementFinding {
  double probability = 0;  // that it has an effect, all others as they are found
  // Of the effect where it is there: skew as a tilt (root mean square over six faces), others the
  // largest of the three axes, with its sign.
  double size = 0;
  double standard_uncertainty = 0;
  std::size_t axis = 0;       // of zero and sensitivity
  std::vector<double> value;  // skew: twelve, in the order of SkewPattern; else three
  // Skew of jigs: of `probability` the part that is a tilt (of that `size`), and each face; and the
  // length of all together.
  double tilt_probability = 0;
  double all_size = 0;
  std::array<FaceFinding, 6> faces{};
  // What explains the readings instead of it about as well (within a factor of 20).
  std::vector<Rival> rivals;
};

struct QuantityFindings {
  std::vector<ElementFinding> jigs;  // skew only
  std::vector<ElementFinding> stations;
  std::vector<ElementFinding> lots;
  std::vector<CrossedScatter> scatter;  // skew: turn, shear, even
  // What is left of each run's reading when all that is found is taken off; by run.
  std::vector<Eigen::VectorXd> own;
  std::array<double, 3> share{};  // learnt: of the jigs, stations and lots that have an effect
};

struct SharedEffects {
  QuantityFindings skew;
  QuantityFindings zero;         // mg
  QuantityFindings sensitivity;  // percent
};

SharedEffects find_shared_effects(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                                  const SharedEffectOptions& options = {});

}  // namespace sixpoint::station
