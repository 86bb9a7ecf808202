// The scenario that makes a bundle's recording again, with the effects that a diagnosis named.
//
//   SIXPOINT_ASSIGN(const gap::Bundle bundle, gap::read_bundle(files, "bundle"));
//   SIXPOINT_ASSIGN(const gap::Diagnosis diagnosis, gap::diagnose(bundle, {}));
//   const Json scenario = recorded_scenario(diagnosis, bundle);   // for `sixpoint simulate`
//
// gap::augmented_scenario() with the bundle's own sample rate, scale, gravity and segments in place of
// a standard protocol, whose poses would come in another order; and with the simulator's noise where
// rounding hides how large the unit's is. Segments follow each other there: what lies between them
// in the recording is left out. Phases of tones and the unit's own temperature log are not in it:
// the simulator draws the ones and follows the commanded temperatures. A pure function.
#pragma once

#include "cli/context.h"
#include "gap/judge/diagnosis.h"
#include "gap/recording/bundle.h"

namespace sixpoint::cli {

Json recorded_scenario(const gap::Diagnosis& diagnosis, const gap::Bundle& bundle);

}  // namespace sixpoint::cli
