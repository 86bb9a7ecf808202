// What is missing, per unit: how many of its files are affected and repaired, which sides were up
// in their still periods, and what would help the rest.
//
//   UnitTable table({SourceKind::store, SourceKind::scan});
//   table.add(report);                     // of every file
//   for (const UnitNeeds& unit : table.rows()) {
//     unit.help;   // "3 files wait for constants; -z was never up: put the unit on the jig, ..."
//   }
//
// `help`, by the first row that fits:
//
// | of the unit's affected files                                | help                           |
// |-------------------------------------------------------------|--------------------------------|
// | none is without a repair                                    | nothing                        |
// | some have no constants, and its sets or files contradict    | the jig: a person must decide  |
// | ... and a side was never up                                 | that side: the jig, or a       |
// |                                                             | calibration file               |
// | ... and all sides were up, the still periods were asked     | they do not suffice: the jig,  |
// |                                                             | or a calibration file          |
// | ... and all sides were up, they were not asked              | --or-scan; where they do not   |
// |                                                             | suffice: the jig, or a         |
// |                                                             | calibration file               |
// | all have constants, and all that were not written are       | their reasons                  |
// | outdated                                                    |                                |
// | ... and some were not applied                               | their reasons; what_may_help() |
// |                                                             | (gate.h) by the sides of all   |
// | ... of the store                                            | ... and `history`              |
// | they were only scanned                                      | repair; and the sides, if any  |
//
// Files that say no serial number, or cannot be read, are the unit "".
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "repair/rescale/repair_file.h"
#include "repair/rescale/sources.h"
#include "repair/triage/scan_file.h"
#include "repair/units/unit_answer.h"

namespace sixpoint::repair {

struct UnitNeeds {
  std::string serial;
  std::size_t files = 0;  // 0: not counted (a plan counts the affected ones alone)
  std::size_t affected = 0;
  std::size_t repaired = 0;
  std::size_t waiting = 0;        // affected, and no constants were found
  std::size_t refused = 0;        // affected, with constants, and not written or outdated
  std::size_t not_applied = 0;    // of `refused`: not outdated
  bool of_still_periods = false;  // ... by constants of the unit's own still periods
  bool of_store = false;          // ... by those of the store
  std::size_t scanned = 0;        // affected, and constants were not asked for
  std::size_t cannot_tell = 0;    // whether they are affected
  std::size_t failed = 0;         // could not be read or written
  bool contradiction = false;
  bool own_asked = false;                  // the files' own still periods were asked for constants
  std::vector<std::string> sides_covered;  // by the affected files together
  std::vector<std::string> sides_missing;
  std::string help;
};
std::string what_would_help(const UnitNeeds& unit);

class UnitTable {
 public:
  // `asked`: the sources of constants of the run whose reports are added
  // (repair/rescale/sources.h).
  explicit UnitTable(const std::vector<SourceKind>& asked = {});

  void add(const RepairReport& report);
  void add(const ScannedFile& file);
  // Of a plan: its affected files are those that were asked for their still periods.
  void add(const std::string& serial, const UnitAnswer& answer);

  // Units with affected, undecided or failed files, sorted by serial number.
  std::vector<UnitNeeds> rows() const;

 private:
  struct Unit {
    UnitNeeds needs;
    std::set<std::string> sides;
  };
  bool own_asked_;
  std::map<std::string, Unit> units_;
};

// A line per unit, with a header; at most `limit` units (0: all), then how many there are more.
std::string units_text(const std::vector<UnitNeeds>& rows, std::size_t limit = 0);
// As RFC 4180 has it, with a header.
std::string units_csv(const std::vector<UnitNeeds>& rows);
nlohmann::ordered_json units_json(const std::vector<UnitNeeds>& rows);

}  // namespace sixpoint::repair
