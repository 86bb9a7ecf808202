// What people ask the store: which files to repair again, how many units passed, which are due. The
// functions are members of Store (store.h); docs/store.md has the SQL statements.
//
//   SIXPOINT_ASSIGN(const YieldReport report, store.yield(from, to));
//   report.yield();   // 0.97: of the units that were judged, those that passed
#pragma once

#include <map>

#include "db/records.h"

namespace sixpoint::db {

struct UnitRecord {
  std::string serial;
  std::string model;
  UtcTime first_seen;
  std::size_t constants = 0;  // how many sets the store holds, withdrawn ones included
};

// Everything that the store holds about one unit, each list oldest first.
struct UnitHistory {
  std::vector<ConstantsRecord> constants;  // withdrawn sets included
  std::vector<RunRecord> runs;
  std::vector<UnitWrite> writes;
  std::vector<RepairRecord> repairs;    // of this unit's files
  std::vector<Correction> corrections;  // about any of these rows

  bool empty() const;
  // Do these constants apply no more? The last correction decides:
  //
  // | corrections of the set, oldest first (others do not count) | withdrawn |
  // |------------------------------------------------------------|-----------|
  // | none                                                       | no        |
  // | ..., withdraw                                              | yes       |
  // | ..., withdraw, reinstate                                   | no        |
  bool is_withdrawn(const std::string& constants_id) const;
  // The last word of a person about which set of a filter configuration applies: the newest
  // correction "prefer" about a set of it that is not withdrawn; null where there is none.
  const Correction* preference(const std::string& filter) const;
};

// A file that was repaired with constants that are withdrawn: repair it again, unless it was since.
struct RecallEntry {
  RepairRecord repair;
  UtcTime withdrawn_at;
  std::string reason;
  // The last later repair of the same file with constants that are not withdrawn.
  std::optional<UtcTime> repaired_again_at;
};

// A unit that was on a jig.
struct JigUnit {
  std::string serial;
  std::size_t runs = 0;
  UtcTime last_run;
  std::string last_verdict;
};

// When units were check units. A check unit is measured every day: its runs say nothing of the units
// that come to the station, and count in no yield. Of a unit, at whichever station it was named (a
// check unit may be moved):
//
// | decisions about the unit, oldest first | runs that do not count                                |
// |----------------------------------------|-------------------------------------------------------|
// | none                                   | none                                                  |
// | check_unit                             | those that started then or later                      |
// | check_unit, check_unit_end             | those that started between the two                    |
// | check_unit, check_unit, check_unit_end | those that started between the first and the last one |
class CheckUnitTimes {
 public:
  explicit CheckUnitTimes(const std::vector<StationEvent>& events);  // oldest first
  bool hold(const std::string& serial, UtcTime started) const;

 private:
  struct Period {
    UtcTime from;
    std::optional<UtcTime> until;
  };
  std::map<std::string, std::vector<Period>> of_;
};

// Of the jig runs that started in a period, but for those of check units. A run that was stopped or
// inconclusive judges nothing: it says neither for nor against its unit. The numbers are those of
// station/statistics/statistics.h.
//
// | a unit's runs, oldest first | judged | passed | passed_first_time |
// |-----------------------------|--------|--------|-------------------|
// | judge nothing               | no     | no     | no                |
// | judged first: passed        |        |        | yes               |
// | judged first: failed        |        |        | no                |
// | judged last: passed         | yes    | yes    |                   |
// | judged last: failed         | yes    | no     |                   |
struct YieldReport {
  std::size_t runs = 0;
  std::size_t retests = 0;  // runs that name the run which they repeat
  std::size_t units = 0;
  std::size_t judged = 0;
  std::size_t passed = 0;
  std::size_t passed_first_time = 0;
  double yield() const;  // of the units that were judged; NaN where there were none
  double first_pass_yield() const;
};

// A unit whose newest constants (of any configuration, not withdrawn) are old, or that has none.
struct DueUnit {
  std::string serial;
  std::string model;
  std::optional<UtcTime> last_constants;
};

// One calibration of a check unit, for its control chart.
struct TrendPoint {
  ConstantsRecord constants;
  std::string jig;
  std::string station;
  std::string verdict;
  bool withdrawn = false;
};

// Which runs are asked for; an empty member does not restrict.
struct RunFilter {
  std::string kind = "jig";
  std::string serial;
  std::string station;
  std::optional<UtcTime> from = {};  // started then or later
  std::optional<UtcTime> to = {};    // started before
};

// SQL that holds for rows of `constants` that are not withdrawn (UnitHistory::is_withdrawn()).
std::string not_withdrawn();

}  // namespace sixpoint::db
