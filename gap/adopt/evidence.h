// What one diagnosis says for a population: the answer of `gap diagnose --json`, made compact.
//
//   SIXPOINT_ASSIGN(const DocumentEvidence one, read_evidence(text, "unit7.json"));
//   const DocumentEvidence same = evidence_of(diagnosis);
//   one.id == same.id;  // of one recording, however it was named
//
// Documents come from files that anybody may have written: they are checked. Plain data.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

struct EffectEvidence {
  std::string name;
  bool named = false;  // accepted, and with nothing that looks like it
  bool confounded = false;
  double probability = 0;
  std::vector<NamedValue> parameters = {};  // sd empty where the diagnosis states none
};

struct DocumentEvidence {
  std::string id;      // SHA-256 of what follows but `source` and `adoption`
  std::string source;  // for people: the file's or run's name
  std::string serial;  // of a table of readings, which has none: the file's name
  std::string protocol;
  bool inconclusive = false;
  bool unknown = false;                 // something is there that the catalogue lacks
  std::vector<EffectEvidence> effects;  // named ones, and sizes of those that were not named
  std::vector<std::string> not_observable;
  int adoption = 0;  // in which it came; 0: not yet
};

// bad_data where this is no document of `gap diagnose`, or names neither a unit nor a file.
Result<DocumentEvidence> read_evidence(std::string_view json, const std::string& source);
DocumentEvidence evidence_of(const Diagnosis& diagnosis);

// As a scenario keeps it, and back. bad_data, as above.
nlohmann::ordered_json to_json(const DocumentEvidence& evidence);
Result<DocumentEvidence> evidence_from_scenario(const nlohmann::ordered_json& json);

// True for effects of which every unit has a little, so that what was not named has a size too, and
// the population is that of all units.
bool every_unit_has_some(std::string_view effect);

}  // namespace sixpoint::gap
