// What the diagnoses without a protocol share: when an effect is accepted, and how they end.
//
//   if (is_allowed(options, finding.name) && finding.nats > kAccept_nats) {
//     diagnosis.effects.push_back(finding);
//   }
//   finish(diagnosis, options);
#pragma once

#include <string>

#include "gap/explain/decisions.h"
#include "gap/judge/diagnose.h"
#include "gap/judge/diagnosis.h"
#include "gap/judge/findings.h"

namespace sixpoint::gap {

// before_sigma and after_sigma from the milligravities and the floor.
void set_sigmas(GapSize& gap);
// The share of the square of the gap that is explained.
double closed_fraction(const GapSize& gap);

// Lists the effects that were not judged as not observable, sets the shares of the gap of those that
// were, suggests the next segment, and sets the verdict:
//
//   too little data | something unknown | effects found | verdict
//   no              | yes               | none          | unexplained
//   no              | yes               | some          | partly_explained
//   no              | no                | none          | no_gap
//   no              | no                | some          | explained
//   yes             | either            | either        | by inconclusive(), of judge/findings.h
//
// Where `inconclusive` is set, unknown.why says why.
void finish(Diagnosis& diagnosis, const DiagnoseOptions& options);

}  // namespace sixpoint::gap
