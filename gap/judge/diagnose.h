// A bundle in, a Diagnosis out: what `sixpoint gap diagnose` does, as a function.
//
//   const Result<Bundle> bundle = read_bundle(files, "folder");
//   const Result<Diagnosis> diagnosis = diagnose(*bundle, {.without = {"tilt"}});
//   if (diagnosis && diagnosis->verdict == Verdict::explained) {
//     const EffectFinding& first = diagnosis->effects.front();  // strongest first
//     const double left_mg = diagnosis->gap.after_mg;           // with first.name simulated
//   }
//
// Order of the steps: discrete effects are found and undone (clean.h); timing from the host's clock
// and the tones; lines, noise and transients from the records; the amplitude response; then means
// and tone amplitudes together by exact evidence over subsets of effects (explanation.h). What is
// left after that is tested against chance, and named `unknown` if it is too much.
//
// Nats: natural logarithm of odds, or of a likelihood ratio. EffectFinding::nats compares the
// explanation with the effect to the best one without it, prior odds included: 0 is even, 2.2 is
// nine to one and accepted, 7 is a thousand to one. Some are set by convention, not computed: an
// effect that fails a later test gets -0.1, one that belongs to the best explanation at least 0.1.
// `held_out_gain_nats` is predictive: conditions that were not fitted, without a prior.
//
// Probability: of the effect being present, from its nats and from those of other causes that would
// take its place; it is lower beside something unknown. It assumes the priors of decisions.h;
// `gap challenge` measures its calibration (docs/gap.md). It is not the probability that the effect
// matters.
//
// What it can't do: separate effects that one unit shows alike (`confounded_with`: local_gravity
// and gain, rounding_floor and offset); show an effect for which the protocol has no segment
// (`not_observable`); name a cause that the catalogue lacks, which is at most `unknown`, or silence
// if the noise hides it; find more than twelve effects of the means at once.
//
// Deterministic. One call runs in one thread and keeps nothing; calls may run in parallel.
// Errors: usage for a name in `without` that the catalogue does not have.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "gap/explain/learnt_size.h"
#include "gap/judge/diagnosis.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

struct DiagnoseOptions {
  std::set<std::string> without = {};  // effects taken out of the catalogue
  // Raw counts of a unit that is not calibrated yet: its gains and offsets are not judged.
  bool uncalibrated = false;
  // An effect matters from this root mean square per axis on: twice what noise and seating leave of
  // the mean of a ten-second dwell.
  double matters_mg = 0.4;
  // What earlier units of the same kind had, of effects that the means show: learnt_sizes.h.
  std::vector<LearntSize> learnt = {};
  std::uint64_t seed = 0;  // goes into the augmented scenario
};

Result<Diagnosis> diagnose(const Bundle& bundle, const DiagnoseOptions& options = {});

}  // namespace sixpoint::gap
