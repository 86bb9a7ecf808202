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
  std::string retest_of;  // a run's id, or empty
  std::string document;   // JSON: readings, limits used, gravity, temperature, codes
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

class Store {
 public:
  // `location`: a path of an SQLite file, which is made when it is not there. Errors as
  // open_sqlite() and migrate(); usage for a kind of location that this program has no code for.
  static Result<Store> open(Env& env, const std::string& location);

  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;
  ~Store();

  // Adds the unit too when it is new. Returns the id. bad_data for an empty or unprintable serial,
  // an unknown filter, or a document that is no JSON.
  Result<std::string> add_constants(const ConstantsRecord& record, const std::string& model);
  Result<std::string> add_run(const RunRecord& run, const std::vector<Capture>& captures);
  Result<std::string> add_unit_write(const UnitWrite& write);
  Result<std::string> add_repair(const RepairRecord& repair);

  // From now on constants_for() passes over them. They stay in the history.
  Status withdraw_constants(const std::string& id, const std::string& operator_name,
                            const std::string& reason);

  // Which constants apply to a file of `serial` recorded under `filter`: the newest by made_at,
  // among equals the last one stored, that has not been withdrawn. Nothing where there are none.
  Result<std::optional<ConstantsRecord>> constants_for(const std::string& serial,
                                                       const std::string& filter);
  // The whole history, oldest first, withdrawn sets included.
  Result<std::vector<ConstantsRecord>> history(const std::string& serial);
  Result<std::vector<UnitRecord>> units();
  // The repair that made a file of this hash, if one did.
  Result<std::optional<RepairRecord>> repair_of_output(const std::string& output_sha256);

  Result<AuditReport> audit();

 private:
  struct Impl;
  explicit Store(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::db
