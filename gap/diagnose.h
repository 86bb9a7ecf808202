// sixpoint gap diagnose, as a function: a bundle in, a Diagnosis out.
//
// Order: discrete effects are found and undone (clean.h); timing from the host's clock and the
// tones; lines, noise and transients from the records; amplitude response; then means and tone
// amplitudes together by exact evidence over subsets (evidence.h), relinearised about each accepted
// explanation. What is left over anywhere after that is tested against chance and named `unknown`.
// Everything is deterministic. One call runs in one thread and keeps nothing.
#pragma once

#include <set>
#include <string>

#include "gap/bundle.h"
#include "gap/diagnosis.h"

namespace sixpoint::gap {

struct DiagnoseOptions {
  std::set<std::string> without;  // effects taken out of the catalogue
  // Raw counts of a unit that is not calibrated yet: gains and offsets are its own, and no finding.
  bool uncalibrated = false;
  std::uint64_t seed = 0;  // goes into the augmented scenario
};

// usage for a name in `without` that the catalogue has not.
Result<Diagnosis> diagnose(const Bundle& bundle, const DiagnoseOptions& options = {});

}  // namespace sixpoint::gap
