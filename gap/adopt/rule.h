// Which effects of several units' diagnoses a population takes over, and with which numbers.
//
//   for (const AdoptionDecision& decision : decide_adoption(documents)) {
//     std::cout << decision.name << ": " << decision.brief() << '\n';
//   }
//
// Deterministic; the order of the documents does not matter.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gap/adopt/evidence.h"
#include "gap/adopt/mean_and_spread.h"

namespace sixpoint::gap {

struct AdoptionOptions {
  // An effect is adopted where the diagnosis would name it: at nine to one.
  double least_probability = 0.9;
  // What a single unit of several has is its own.
  std::size_t least_units = 2;
};

enum class AdoptionOutcome {
  adopted,         // mean and spread
  spread_only,     // the units differ in sign: spread about 0
  one_unit,        // all documents are of one unit: its size; the spread is not known
  its_own,         // only one of several units has it
  not_named,       // no unit has it for certain
  unknown_beside,  // only documents that also say `unknown` name it
  not_observable,  // no protocol among the documents can show it
  no_mean,         // a setting without a mean (turned axes), which differs between units
  not_simulated,   // the simulator has no such effect
};
std::string_view to_string(AdoptionOutcome outcome);

struct AdoptedNumber {
  std::string parameter;
  std::vector<MeanAndSpread> numbers;  // as many as the parameter has
};

struct AdoptionDecision {
  std::string name;
  AdoptionOutcome outcome = AdoptionOutcome::not_named;
  std::size_t units_naming = 0;
  std::size_t units_able = 0;             // whose protocol can show it
  std::size_t bundles = 0;                // documents behind the numbers
  double share_of_units = 1;              // that have it
  std::vector<AdoptedNumber> parameters;  // of what is adopted

  bool adopted() const {
    return outcome == AdoptionOutcome::adopted || outcome == AdoptionOutcome::spread_only ||
           outcome == AdoptionOutcome::one_unit;
  }
  // Behind the numbers.
  std::size_t units() const {
    return parameters.empty() ? units_naming : parameters.front().numbers.front().units;
  }
  std::string brief() const;  // a sentence for a person
};

// The rule, for each effect that a document names or gives a size. The first row that fits holds.
//
//   the documents                                          the population
//   the simulator has no effect of that name               not_simulated
//   none is conclusive and can show it                     not_observable
//   it is named, but only where `unknown` is said, too     unknown_beside
//   no unit names it                                       not_named
//   all are of one unit, which names it                    one_unit: its numbers, no spread
//   fewer than least_units of several units name it        its_own
//   settings without a mean that differ                    no_mean
//   a size that has a sign, and whose means are within
//     two standard uncertainties of 0, taken together as a
//     root mean square                                     spread_only: mean 0
//   anything else                                          adopted
//
// A unit names an effect if more than half of its documents that can show it do: with
// `least_probability`, not confounded with another effect, and without an `unknown` beside it. A
// document that says `unknown` or is inconclusive counts for nothing, since the unknown may stand
// in its sizes.
//
// Numbers: documents of one unit are averaged by their uncertainties, then units by
// mean_and_spread(). The size of an effect that every unit has some of is taken from all units,
// those that do not name it too: else the mean would be that of the largest. Other effects, and
// time constants, are those of the units that name it; share_of_units says how many have it.
std::vector<AdoptionDecision> decide_adoption(const std::vector<DocumentEvidence>& documents,
                                              const AdoptionOptions& options = {});

}  // namespace sixpoint::gap
