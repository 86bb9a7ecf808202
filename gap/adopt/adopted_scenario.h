// A scenario file that learns: what several units' diagnoses agree on becomes its population.
//
//   SIXPOINT_ASSIGN(AdoptedScenario learnt, adopt(scenario_text, documents, made_at));
//   if (learnt.changed) {
//     SIXPOINT_CHECK(write_file(files, "S.json", learnt.text));
//   }
//
// The scenario keeps the documents (evidence.h) from which its population was estimated, so that
// further ones are pooled with them: in two steps or in one, the population is the same. It also
// keeps the history: each adoption with its time and what it brought. Whatever else the scenario
// says stays, and wins: an effect that stands in `effects`, or that somebody wrote into
// `population`, is not replaced.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "base/time.h"
#include "gap/adopt/rule.h"
#include "sim/effects/population.h"

namespace sixpoint::gap {

// How one effect of the population came through an adoption.
enum class AdoptionChange {
  none,  // it was not there, and is not; or it is as it was
  added,
  changed,    // its numbers
  withdrawn,  // it was adopted earlier; with the further documents it no longer is
  kept,       // the scenario's own entry stays; nothing was adopted
};
std::string_view to_string(AdoptionChange change);

struct AdoptedEffect {
  AdoptionDecision decision;
  AdoptionChange change = AdoptionChange::none;
};

struct AdoptedScenario {
  std::string text;  // of the file; the given one where nothing changed
  bool changed = false;
  int adoption = 0;                         // number of this one; of the last one if none changed
  std::size_t new_documents = 0;            // others were there already
  std::vector<AdoptedEffect> effects;       // of all documents, by name
  std::vector<DocumentEvidence> documents;  // all, the earlier ones first
};

// `scenario`: the text of one; empty: a new one, of the protocol that most documents have.
// configuration where it is none, bad_data where its documents were changed by hand.
Result<AdoptedScenario> adopt(std::string_view scenario,
                              const std::vector<DocumentEvidence>& documents, UtcTime made_at,
                              const AdoptionOptions& options = {});

// The population as it was after each adoption, oldest first; none where nothing was adopted.
struct PopulationState {
  int adoption = 0;
  std::string made_at;  // ISO 8601
  std::size_t documents = 0;
  std::vector<sim::PopulationEffect> population;
};
struct ScenarioHistory {
  std::vector<PopulationState> states;
  std::set<std::string> documents;  // ids of those that it has learnt from (evidence.h)
};
Result<ScenarioHistory> adoption_history(std::string_view scenario,
                                         const AdoptionOptions& options = {});

// For the simulator. Effects that it can't take (a setting that it does not know) are left out.
std::vector<sim::PopulationEffect> population_of(const std::vector<AdoptionDecision>& decisions);

}  // namespace sixpoint::gap
