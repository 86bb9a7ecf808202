// The store: what was measured, on which unit, by which operator, and which constants repaired
// which file.
//
//   SIXPOINT_ASSIGN(auto store, Store::open(env, "plant.db"));
//   SIXPOINT_ASSIGN(const auto id, store.add_constants(record, "wGT3XBT"));
//   SIXPOINT_ASSIGN(const auto sets, store.constants_history("MOS2A1"));
//
// Rows are only ever added. Constants belong to (serial number, filter configuration); new ones
// stand beside the old ones. Which of them apply is the question of
// repair/rescale/applying_constants.h.
// A mistake is corrected by a new row with a reason (withdraw_constants()). Every row is chained to
// the one before by SHA-256 (chain.h), and audit() finds any that was changed, removed or moved.
//
// A Store belongs to one thread; several processes may work on one file at once.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/sha256.h"
#include "db/audit.h"
#include "db/questions.h"
#include "db/records.h"
#include "db/servers/database.h"

namespace sixpoint::db {

class Store final : public RecordWriter {
 public:
  // `location`: a path of an SQLite file, which is made when it is not there, or postgresql://...
  // Errors as open_sqlite(), open_postgres() and migrate().
  static Result<Store> open(Env& env, const std::string& location);
  // As open(), of a store that is there: of a database without one, no_input.
  static Result<Store> open_existing(Env& env, const std::string& location);
  // Only to read, also where nothing may be written: a store of an earlier version is refused
  // (configuration), and so is a place where there is none (no_input).
  static Result<Store> open_to_read(Env& env, const std::string& location);
  // In a database that is open: one that is empty becomes a store. Errors as migrate().
  static Result<Store> in(Env& env, std::unique_ptr<Database> database);
  // Ends with its object: for tests.
  static Result<Store> in_memory(Env& env);

  // The tables themselves, for exchange.h and for tests. Only this class adds rows to them.
  Database& database() { return *database_; }

  // Adds the rows that the store does not have yet, in one transaction.
  Result<std::string> add(NewRows rows) override;

  // The key of the row of `table` (schema.h) that a person names by `given`, an id in any letters:
  //
  // | `given`                              | rows whose key begins so | answer                   |
  // |--------------------------------------|--------------------------|--------------------------|
  // | a whole key                          | any number               | it                       |
  // | 8 hexadecimal digits or more         | one                      | its key                  |
  // | 8 hexadecimal digits or more         | several                  | usage: more digits       |
  // | 8 hexadecimal digits or more         | none                     | no_input                 |
  // | fewer digits, or anything else       | any number               | no_input                 |
  // | the beginning of a serial number     | any number               | no_input                 |
  Result<std::string> whole_key(std::string_view table, const std::string& given);

  // Adds a correction, made now; `row_id` as whole_key() takes it. no_input where there is no such
  // row; usage for another action, or without a reason.
  //
  // | action              | of which rows                               |
  // |---------------------|---------------------------------------------|
  // | withdraw, reinstate | constants                                   |
  // | prefer              | constants; usage where they are withdrawn   |
  // | note                | any of any table                            |
  Result<std::string> correct(const Correction& correction);
  // From now on they do not apply. They stay in the history.
  Status withdraw_constants(const std::string& id, const std::string& operator_name,
                            const std::string& reason);

  // usage for an unknown action, one without its unit, or without operator or reason.
  Result<std::string> add_station_event(const StationEvent& event);
  // Oldest first; of all stations with an empty `station`.
  Result<std::vector<StationEvent>> station_events(const std::string& station = {});
  // Runs, oldest first, one at a time: a year of them does not fit into memory. An error of `visit`
  // ends it.
  Status for_each_run(const RunFilter& filter,
                      const std::function<Status(const RunRecord&)>& visit);

  // The sets of constants of a unit and the corrections about them, without the rest of its
  // history.
  Result<UnitHistory> constants_history(const std::string& serial);
  // UnitHistory::is_withdrawn() of the set of this whole id; no_input where there is none.
  Result<bool> is_withdrawn(const std::string& constants_id);
  // The whole history, oldest first, withdrawn sets included.
  Result<std::vector<ConstantsRecord>> history(const std::string& serial);
  Result<UnitHistory> unit_history(const std::string& serial);
  // `id`: as whole_key() takes it.
  Result<RunRecord> run(const std::string& id);
  Result<std::vector<UnitRecord>> units();
  // The repair that made a file of this hash, if one did.
  Result<std::optional<RepairRecord>> repair_of_output(const std::string& output_sha256);

  // What people ask (questions.h). recall_list: files repaired with constants that are withdrawn;
  // with an empty `constants_id`, with any of them.
  Result<std::vector<RecallEntry>> recall_list(const std::string& constants_id = {});
  Result<std::vector<JigUnit>> units_of_jig(const std::string& jig);
  Result<YieldReport> yield(UtcTime from, UtcTime to);
  Result<std::vector<DueUnit>> units_due(UtcTime older_than);
  Result<std::vector<TrendPoint>> trend(const std::string& serial);

  // As it is written in the store; audit() says whether the rows agree.
  Result<StoreHead> head();
  // The hash of the row of a run: a head that stays in the chain, for what is handed out about that
  // run. no_input where there is none.
  Result<std::string> head_of_run(const std::string& id);
  // Reads everything, as it is at this moment, while others go on writing. With the hex hash of an
  // earlier head, also whether that is still a row of the chain: this alone shows a history that
  // was written anew from its beginning.
  Result<AuditReport> audit(const std::string& earlier_head = {});

 private:
  Store(Env& env, std::unique_ptr<Database> database)
      : env_(&env), database_(std::move(database)) {}
  // The records of a table for which `clauses` hold ("WHERE ... ORDER BY ...").
  template <class Record>
  Result<std::vector<Record>> select(const std::string& clauses,
                                     std::span<const Value> parameters = {});

  Env* env_;
  std::unique_ptr<Database> database_;
};

template <class Record>
Result<std::vector<Record>> Store::select(const std::string& clauses,
                                          std::span<const Value> parameters) {
  const Table& from = table(Record::kTable);
  std::string sql = "SELECT " + record_columns(from) + " FROM ";
  sql.append(from.name).append(" ").append(clauses);
  SIXPOINT_ASSIGN(const auto rows, database_->query(sql, parameters));
  std::vector<Record> records;
  records.reserve(rows.size());
  for (const Row& row : rows) {
    records.push_back(record_of<Record>(row));
  }
  return records;
}

}  // namespace sixpoint::db
