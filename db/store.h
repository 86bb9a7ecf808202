// The store: what was measured, on which unit, by whom, and which constants mended which file.
//
// Rows are only ever added. Constants belong to (serial number, filter configuration); new ones
// stand beside the old ones, and constants_for() answers with the newest that nobody has withdrawn.
// A mistake is corrected by a new row with a reason (withdraw()). Every row is chained to the one
// before by SHA-256 (chain.h), and audit() finds any that was changed, removed or moved.
//
// Identifiers are the first 32 hex digits of the SHA-256 of the row's own content, so that the same
// row sent twice (a retry after a lost answer) is stored once.
//
// A Store belongs to one thread; several processes may work on one file at once.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/sha256.h"
#include "db/database.h"

namespace sixpoint::db {

// Constants of one unit under one filter configuration, as they were determined.
struct ConstantsRecord {
  std::string id;   // filled by the store
  UtcTime made_at;  // when they were determined
  std::string serial;
  std::string filter;    // "legacy" or "current"
  std::string method;    // "jig", "ls", "ga" ...
  std::string run_id;    // the run that made them, or empty
  std::string document;  // JSON in the form of constants.json (docs/constants-file.md)
  // JSON, filled by the store from the document's `standard_uncertainty` and `made_from`.
  std::string standard_uncertainty = {};
  std::string origin = {};
};

struct UnitRecord {
  std::string serial;
  std::string model;
  UtcTime first_seen;
  std::size_t constants = 0;  // how many sets the store holds, withdrawn ones included
};

// One jig run, capture or scan, as it ended.
struct RunRecord {
  std::string id;  // filled by the store
  std::string serial;
  std::string model;
  std::string kind;
  std::string filter;
  UtcTime started;
  UtcTime ended;
  std::string operator_name;
  std::string station;
  std::string jig;
  std::string verdict;
  std::string software;
  std::string retest_of;                        // a run's id, or empty
  std::string document;                         // JSON: the whole report
  std::optional<UtcTime> jig_due = {};          // when the jig itself is due for calibration
  std::string build = {};                       // commit or package version of the software
  std::string limits = {};                      // JSON: the limits that the verdict used
  std::optional<double> gravity_m_per_s2 = {};  // local gravity
  std::optional<double> temperature_c = {};     // of the unit during the run
  std::vector<std::string> codes = {};          // the verdict's reasons
};

// Raw data of a run, kept as it came.
struct Capture {
  std::string name;
  Bytes bytes;
};

struct UnitWrite {
  std::string run_id;
  std::string serial;
  UtcTime written;
  std::string as_found;   // JSON of the nine constants before
  std::string as_left;    // what was written
  std::string read_back;  // what the unit then answered
};

struct RepairRecord {
  std::string id;  // filled by the store
  std::string serial;
  UtcTime made_at;
  std::string input;  // the file's name as it was given
  std::string input_sha256;
  std::string output_sha256;
  std::string method;
  std::string constants_id;  // empty where the constants came from outside the store
  std::string document;
  std::string software = {};
};

// A later word about a row: nothing is changed, this row is added.
struct Correction {
  std::string id;  // filled by the store
  UtcTime made_at{};
  std::string table;   // about which row: its table ...
  std::string row_id;  // ... and its key
  // "withdraw": constants apply no more. "reinstate": they apply again. "note": what is wrong or
  // missing there, in words.
  std::string action;
  std::string operator_name;
  std::string reason;
};

// What people decided at a station.
struct StationEvent {
  std::string id;  // filled by the store
  UtcTime made_at{};
  std::string station;
  std::string serial;  // the unit that it is about; empty for the station itself
  // "check_unit": this unit watches the station from now on. "check_unit_end": no more. "sign": an
  // engineer has looked at what the check units say. "sign_new_baseline": and what they said before
  // is no measure any more. "release": this unit may be measured again after too many failures.
  std::string action;
  std::string operator_name;
  std::string reason;
};

// Which runs are asked for; what is empty does not matter.
struct RunFilter {
  std::string kind = "jig";
  std::string serial;
  std::string station;
  std::optional<UtcTime> from = {};  // started then or later
  std::optional<UtcTime> to = {};    // started before
};

// Everything that the store holds about one unit, each list oldest first.
struct UnitHistory {
  std::vector<ConstantsRecord> constants;  // withdrawn sets included
  std::vector<RunRecord> runs;
  std::vector<UnitWrite> writes;
  std::vector<RepairRecord> repairs;    // of this unit's files
  std::vector<Correction> corrections;  // about any of these rows

  bool empty() const;
  // The last word about these constants is "withdraw".
  bool is_withdrawn(const std::string& constants_id) const;
};

// A file that was mended with constants that were withdrawn later or before: mend it again.
struct RecallEntry {
  RepairRecord repair;
  UtcTime withdrawn_at;
  std::string reason;
};

// A unit that was on a jig.
struct JigUnit {
  std::string serial;
  std::size_t runs = 0;
  UtcTime last_run;
  std::string last_verdict;
};

// Of the jig runs that started in a period.
struct YieldReport {
  std::size_t runs = 0;
  std::size_t retests = 0;  // of them, that name the run which they repeat
  std::size_t units = 0;
  std::size_t passed = 0;             // units whose last run passed
  std::size_t passed_first_time = 0;  // units whose first run passed
  double yield() const;               // NaN where there were no units
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

struct AuditReport {
  bool ok = false;
  std::int64_t rows = 0;
  std::string head;                   // hex SHA-256 of the last row
  std::vector<std::string> findings;  // what is wrong, the first few

  std::string brief() const;
  bool usable() const { return ok; }
  nlohmann::ordered_json to_json() const;  // ok, rows, head, findings
};

// The id that the store gives to a record, and the same errors where it would refuse it by itself:
// known without a store, so that records can be named while it is away (journal.h).
Result<std::string> id_of(const ConstantsRecord& record);
Result<std::string> id_of(const RunRecord& run, const std::vector<Capture>& captures);
Result<std::string> id_of(const UnitWrite& write);
Result<std::string> id_of(const RepairRecord& repair);

// A file's name as the store keeps it: bytes that are no UTF-8 are written \xNN.
std::string storable_path(std::string_view path);

// What takes records for good: the store, or the journal in its stead (journal.h, keeping.h).
// Each answers with the id, which is the same from both.
class Keeper {
 public:
  virtual ~Keeper() = default;
  virtual Result<std::string> add_constants(const ConstantsRecord& record,
                                            const std::string& model) = 0;
  virtual Result<std::string> add_run(const RunRecord& run,
                                      const std::vector<Capture>& captures) = 0;
  virtual Result<std::string> add_unit_write(const UnitWrite& write) = 0;
  virtual Result<std::string> add_repair(const RepairRecord& repair) = 0;
};

class Store final : public Keeper {
 public:
  // `location`: a path of an SQLite file, which is made when it is not there, or postgresql://...
  // Errors as open_sqlite(), open_postgres() and migrate().
  static Result<Store> open(Env& env, const std::string& location);

  // What the store is made of, for exchange.h and journal.h. Rows belong into it by this class
  // only.
  Database& database();

  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;
  ~Store() override;

  // Adds the unit too when it is new (first seen at the record's own time). Returns the id.
  // bad_data for an empty or unprintable serial, an unknown filter, a document that is no JSON, a
  // text that is no UTF-8 or too long, a capture above 100 MiB.
  Result<std::string> add_constants(const ConstantsRecord& record,
                                    const std::string& model) override;
  Result<std::string> add_run(const RunRecord& run, const std::vector<Capture>& captures) override;
  Result<std::string> add_unit_write(const UnitWrite& write) override;
  Result<std::string> add_repair(const RepairRecord& repair) override;

  // Adds a correction, made now. no_input where there is no such row; usage without a reason, for
  // another action, or for one that does not fit the table (only constants are withdrawn).
  Result<std::string> correct(const Correction& correction);
  // From now on constants_for() passes over them. They stay in the history.
  Status withdraw_constants(const std::string& id, const std::string& operator_name,
                            const std::string& reason);

  // usage for an unknown action, one without its unit, or without operator or reason.
  Result<std::string> add_station_event(const StationEvent& event);
  // Oldest first; of all stations with an empty `station`.
  Result<std::vector<StationEvent>> station_events(const std::string& station = {});
  // Runs, oldest first, one at a time: a year of them does not fit into memory. `model` is left
  // empty. An error of `visit` ends it.
  Status for_each_run(const RunFilter& filter,
                      const std::function<Status(const RunRecord&)>& visit);

  // Which constants apply to a file of `serial` recorded under `filter`: the newest by made_at,
  // among equals the last one stored, whose last correction is no withdrawal. Nothing where there
  // are none.
  Result<std::optional<ConstantsRecord>> constants_for(const std::string& serial,
                                                       const std::string& filter);
  // The whole history, oldest first, withdrawn sets included.
  Result<std::vector<ConstantsRecord>> history(const std::string& serial);
  Result<UnitHistory> unit_history(const std::string& serial);
  // no_input where there is none.
  Result<RunRecord> run(const std::string& id);
  Result<std::vector<UnitRecord>> units();
  // The repair that made a file of this hash, if one did.
  Result<std::optional<RepairRecord>> repair_of_output(const std::string& output_sha256);

  // What people ask (docs/store.md has the statements).
  // Files mended with constants that are withdrawn; `constants_id` empty: with any of them.
  Result<std::vector<RecallEntry>> recall_list(const std::string& constants_id = {});
  Result<std::vector<JigUnit>> units_of_jig(const std::string& jig);
  Result<YieldReport> yield(UtcTime from, UtcTime to);
  Result<std::vector<DueUnit>> units_due(UtcTime older_than);
  Result<std::vector<TrendPoint>> trend(const std::string& serial);

  // Reads everything, as it is at this moment, while others go on writing. With the hex hash of an
  // earlier head, also whether that is still a row of the chain: only so is a history found out
  // that was written anew from end to end.
  Result<AuditReport> audit(const std::string& earlier_head = {});

 private:
  struct Impl;
  explicit Store(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::db
