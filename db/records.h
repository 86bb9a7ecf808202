// The records of the store, and the rows of its tables that they become.
//
//   ConstantsRecord record;
//   record.serial = "MOS2A1";
//   record.filter = "current";
//   record.document = R"({"schema":"sixpoint/constants/1"})";
//   SIXPOINT_ASSIGN(const NewRows rows, rows_of(record, "wGT3XBT"));
//   rows.id;   // 32 hex digits, the same wherever the record is added
//
// An id is the first 32 hex digits of the SHA-256 of the row's own content (chain.h), so the same
// record sent twice (a retry after a lost answer) is stored once. Times are UTC. All types are
// plain data without links to the store.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/env.h"
#include "db/schema.h"
#include "db/servers/database.h"

namespace sixpoint::db {

// The part of an id that people are shown: 12 digits, which Store::whole_key() takes as well. JSON
// has whole ids.
inline std::string shown_id(const std::string& id) { return id.substr(0, 12); }

// Constants of one unit under one filter configuration, as they were determined.
struct ConstantsRecord {
  static constexpr std::string_view kTable = "constants";
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

// One jig run, capture or scan, as it ended.
struct RunRecord {
  static constexpr std::string_view kTable = "runs";
  std::string id;  // filled by the store
  std::string serial;
  std::string model;  // of the unit; not part of the run's row, so empty in what the store answers
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
  // Hex, of its row in the chain: Store::run() fills it. It is a head that 'audit verify' knows.
  std::string head = {};
};

// Raw data of a run, byte for byte.
struct Capture {
  std::string name;
  Bytes bytes;
};

struct UnitWrite {
  static constexpr std::string_view kTable = "unit_writes";
  std::string run_id;
  std::string serial;
  UtcTime written;
  std::string as_found;   // JSON of the nine constants before
  std::string as_left;    // what was written
  std::string read_back;  // what the unit then answered
};

struct RepairRecord {
  static constexpr std::string_view kTable = "repairs";
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

// A later statement about a row: nothing is changed, this row is added.
struct Correction {
  static constexpr std::string_view kTable = "corrections";
  std::string id = {};  // filled by the store
  UtcTime made_at{};
  std::string table;   // the row's table ...
  std::string row_id;  // ... and its key
  // "withdraw": constants apply no more. "reinstate": they apply again. "prefer": of the sets of
  // their unit and filter, they apply. "note": what is wrong or missing in the row, in a sentence.
  std::string action;
  std::string operator_name;
  std::string reason;
};

// What people decided at a station.
struct StationEvent {
  static constexpr std::string_view kTable = "station_events";
  std::string id = {};  // filled by the store
  UtcTime made_at{};
  std::string station;
  std::string serial;  // of the unit; empty where the event is about the station itself
  // | action            | about     | meaning                                                  |
  // |-------------------|-----------|----------------------------------------------------------|
  // | check_unit        | a unit    | this unit checks the station from now on                 |
  // | check_unit_end    | a unit    | it does so no more                                       |
  // | sign              | a station | an engineer has read the check units' charts             |
  // | sign_new_baseline | a station | the same, and their earlier values are no reference more |
  // | release           | a unit    | it may be measured again after too many failures         |
  std::string action;
  std::string operator_name;
  std::string reason;
};

// A row as the store answers it (record_columns() in schema.h, perhaps followed by others).
template <class Record>
Record record_of(const Row& row);

// A new row of `table` from its columns, the key last computed where it is an id: then `columns`
// begins behind it. bad_data for what a column may not hold (Content in schema.h).
Result<Row> new_row(const Table& table, Row columns);
// The same of a correction or a station's event.
Result<Row> new_row(const Correction& correction);
Result<Row> new_row(const StationEvent& event);

// Everything that one record adds to the store: its unit and its filter configuration too.
struct NewRows {
  std::string id;  // of the record
  std::vector<std::pair<const Table*, Row>> rows = {};
  std::vector<std::pair<std::string, Bytes>> attachments = {};  // by the SHA-256 of their bytes
};

// bad_data for a serial number that is empty, unprintable or above 200 bytes, an unknown filter, a
// document that is no JSON, a text that is no UTF-8 or too long, a capture above 100 MiB.
Result<NewRows> rows_of(const ConstantsRecord& record, const std::string& model);
Result<NewRows> rows_of(const RunRecord& run, const std::vector<Capture>& captures);
Result<NewRows> rows_of(const UnitWrite& write);
Result<NewRows> rows_of(const RepairRecord& repair);

// A file's name as the store writes it: bytes that are no UTF-8 become \xNN.
std::string storable_path(std::string_view path);

// What stores records durably: the store, or the journal where the store does not take them
// (journal.h, save.h). Each function returns the id, which is the same from both.
class RecordWriter {
 public:
  virtual ~RecordWriter() = default;
  virtual Result<std::string> add(NewRows rows) = 0;

  Result<std::string> add_constants(const ConstantsRecord& record, const std::string& model);
  Result<std::string> add_run(const RunRecord& run, const std::vector<Capture>& captures);
  Result<std::string> add_unit_write(const UnitWrite& write);
  Result<std::string> add_repair(const RepairRecord& repair);
};

}  // namespace sixpoint::db
