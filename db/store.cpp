#include "db/store.h"

#include <algorithm>

#include <fmt/format.h>

#include "db/history.h"

namespace sixpoint::db {
namespace {

// Is there a row with this key?
Result<bool> has_row(Database& database, const Table& table, const Value& key) {
  const std::vector<Value> parameters = {key};
  SIXPOINT_ASSIGN(const auto rows, database.query(fmt::format("SELECT seq FROM {} WHERE {} = $1",
                                                              table.name, table.columns[0].name),
                                                  parameters));
  return !rows.empty();
}

// Of hexadecimal digits: an id is kept with small letters.
std::string in_small_letters(std::string text) {
  std::ranges::transform(text, text.begin(), [](char letter) {
    return letter >= 'A' && letter <= 'F' ? static_cast<char>(letter - 'A' + 'a') : letter;
  });
  return text;
}

bool is_blank(const std::string& text) {
  return text.find_first_not_of(" \t") == std::string::npos;
}

bool may_be_beginning_of_id(const std::string& text) {
  constexpr std::size_t kFewest = 8;
  return text.size() >= kFewest && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

NewRows single_row(std::string_view table_name, Row row) {
  NewRows rows{text_of(row[0])};
  rows.rows.emplace_back(&table(table_name), std::move(row));
  return rows;
}

bool is_postgres(const std::string& location) {
  return location.starts_with("postgresql://") || location.starts_with("postgres://");
}

Result<std::unique_ptr<Database>> open_database(const std::string& location) {
  return is_postgres(location) ? open_postgres(location) : open_sqlite(location);
}

}  // namespace

Result<Store> Store::open(Env& env, const std::string& location) {
  SIXPOINT_ASSIGN(auto database, open_database(location));
  return in(env, std::move(database));
}

Result<Store> Store::open_existing(Env& env, const std::string& location) {
  SIXPOINT_ASSIGN(auto database, open_database(location));
  SIXPOINT_ASSIGN(const std::int64_t version, database->schema_version());
  if (version == 0) {
    return fail(ErrorCode::no_input, "there is no store in this database", database->location(),
                "name another one, or make one with 'sixpoint jig' or 'sixpoint solve --save'");
  }
  return in(env, std::move(database));
}

Result<Store> Store::open_to_read(Env& env, const std::string& location) {
  SIXPOINT_ASSIGN(auto database, is_postgres(location) ? open_postgres(location)
                                                       : open_sqlite(location, Access::read));
  SIXPOINT_ASSIGN(const std::int64_t version, database->schema_version());
  if (version != kSchemaVersion) {
    return fail(ErrorCode::configuration,
                fmt::format("the store has version {}, this program reads version {}", version,
                            kSchemaVersion),
                database->location(),
                "a user who may write it has to open it once, with this program");
  }
  return Store(env, std::move(database));
}

Result<Store> Store::in(Env& env, std::unique_ptr<Database> database) {
  SIXPOINT_CHECK(migrate(*database));
  return Store(env, std::move(database));
}

Result<Store> Store::in_memory(Env& env) {
  SIXPOINT_ASSIGN(auto database, open_sqlite_in_memory());
  return in(env, std::move(database));
}

Result<std::string> Store::add(NewRows rows) {
  SIXPOINT_ASSIGN(auto transaction, Transaction::writing(*database_));
  SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(*database_));
  for (auto& [name, bytes] : rows.attachments) {
    SIXPOINT_CHECK(writer.add_attachment(name, std::move(bytes)));
  }
  const std::int64_t before = writer.head().rows;
  for (const auto& [into, row] : rows.rows) {
    // A row whose key is there is the same row: its key names its content.
    SIXPOINT_ASSIGN(const bool known, has_row(*database_, *into, row[0]));
    if (!known) {
      SIXPOINT_CHECK(writer.append(*into, row));
    }
  }
  if (writer.head().rows > before) {
    SIXPOINT_CHECK(writer.finish());
    SIXPOINT_CHECK(transaction.commit());
  }
  return std::move(rows.id);
}

Result<std::string> Store::correct(const Correction& correction) {
  const Table* about = find_table(correction.table);
  if (about == nullptr) {
    std::string names;
    for (const Table& known : tables()) {
      names += fmt::format(" {}", known.name);
    }
    return fail(ErrorCode::usage, fmt::format("no table '{}'", printable(correction.table, 60)), {},
                "there are:" + names);
  }
  const bool of_constants = correction.action == "withdraw" || correction.action == "reinstate" ||
                            correction.action == "prefer";
  if (of_constants ? correction.table != "constants" : correction.action != "note") {
    return fail(
        ErrorCode::usage,
        fmt::format("no correction '{}' of {}", printable(correction.action, 60), correction.table),
        {}, "constants are withdrawn, reinstated and preferred; any row can have a note");
  }
  if (is_blank(correction.reason)) {
    return fail(ErrorCode::usage, "a correction needs a reason", {}, "say why");
  }
  Correction now = correction;
  now.made_at = env_->clock.now();
  SIXPOINT_ASSIGN(now.row_id, whole_key(correction.table, correction.row_id));
  if (correction.action == "prefer") {
    SIXPOINT_ASSIGN(const bool withdrawn, is_withdrawn(now.row_id));
    if (withdrawn) {
      return fail(ErrorCode::usage, "constants that are withdrawn apply to nothing", now.row_id,
                  "reinstate them first, or prefer another set");
    }
  }
  SIXPOINT_ASSIGN(Row row, new_row(now));
  return add(single_row("corrections", std::move(row)));
}

Result<std::string> Store::whole_key(std::string_view table_name, const std::string& given) {
  const Table& table = db::table(table_name);
  // A serial number is no id: the beginning of one may be another unit's.
  const bool by_id = table.columns[0].name == "id";
  const std::string key = by_id ? in_small_letters(given) : given;
  SIXPOINT_ASSIGN(const bool known, has_row(*database_, table, key));
  if (known) {
    return key;
  }
  std::vector<Row> rows;
  if (by_id && may_be_beginning_of_id(key)) {
    // Not by order: in a Danish database "aa" stands behind "z".
    SIXPOINT_ASSIGN(
        rows,
        database_->query(fmt::format("SELECT {0} FROM {1} WHERE substr({0}, 1, {2}) = $1 LIMIT 2",
                                     table.columns[0].name, table.name, key.size()),
                         std::vector<Value>{key}));
  }
  if (rows.size() == 1) {
    return text_of(rows[0][0]);
  }
  if (rows.empty()) {
    return fail(ErrorCode::no_input, fmt::format("no {} '{}'", table.name, printable(given, 60)),
                database_->location(), "'sixpoint history SERIAL' lists them");
  }
  return fail(ErrorCode::usage,
              fmt::format("several {} begin with '{}'", table.name, printable(given, 60)),
              database_->location(), "give more of its digits");
}

Result<bool> Store::is_withdrawn(const std::string& constants_id) {
  SIXPOINT_ASSIGN(const auto sets,
                  select<ConstantsRecord>("WHERE id = $1", std::vector<Value>{constants_id}));
  if (sets.empty()) {
    return fail(ErrorCode::no_input, fmt::format("no constants '{}'", printable(constants_id, 60)),
                database_->location(), "'sixpoint history SERIAL' lists them");
  }
  SIXPOINT_ASSIGN(const UnitHistory history, constants_history(sets[0].serial));
  return history.is_withdrawn(constants_id);
}

Status Store::withdraw_constants(const std::string& id, const std::string& operator_name,
                                 const std::string& reason) {
  SIXPOINT_CHECK(correct({"", {}, "constants", id, "withdraw", operator_name, reason}));
  return {};
}

Result<std::string> Store::add_station_event(const StationEvent& event) {
  const bool about_unit =
      event.action == "check_unit" || event.action == "check_unit_end" || event.action == "release";
  if (!about_unit && event.action != "sign" && event.action != "sign_new_baseline") {
    return fail(ErrorCode::usage,
                fmt::format("nothing at a station is called '{}'", printable(event.action, 60)), {},
                "please report this");
  }
  if (about_unit) {
    SIXPOINT_CHECK(new_row(table("units"), {event.serial, "", to_ns(UtcTime())}));
  }
  if (is_blank(event.operator_name) || is_blank(event.reason)) {
    return fail(ErrorCode::usage, "a decision needs a name and a reason", {},
                "say who decides, and why");
  }
  StationEvent now = event;
  now.made_at = env_->clock.now();
  SIXPOINT_ASSIGN(Row row, new_row(now));
  return add(single_row("station_events", std::move(row)));
}

Result<std::vector<StationEvent>> Store::station_events(const std::string& station) {
  if (station.empty()) {
    return select<StationEvent>("ORDER BY seq");
  }
  return select<StationEvent>("WHERE station = $1 ORDER BY seq", std::vector<Value>{station});
}

Status Store::for_each_run(const RunFilter& filter,
                           const std::function<Status(const RunRecord&)>& visit) {
  std::vector<Value> parameters;
  std::string where = "seq > 0";
  const auto only = [&](bool given, std::string_view condition, Value value) {
    if (given) {
      parameters.push_back(std::move(value));
      where += fmt::format(" AND {} ${}", condition, parameters.size());
    }
  };
  only(!filter.kind.empty(), "kind =", filter.kind);
  only(!filter.serial.empty(), "serial =", filter.serial);
  only(!filter.station.empty(), "station =", filter.station);
  only(filter.from.has_value(), "started_ns >=", to_ns(filter.from.value_or(UtcTime())));
  only(filter.to.has_value(), "started_ns <", to_ns(filter.to.value_or(UtcTime())));
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*database_));
  SIXPOINT_ASSIGN(const auto rows,
                  database_->stream(fmt::format("SELECT {} FROM runs WHERE {} "
                                                "ORDER BY started_ns, seq",
                                                record_columns(table("runs")), where),
                                    parameters));
  return for_each_row(*rows, [&](const Row& row) { return visit(record_of<RunRecord>(row)); });
}

Result<UnitHistory> Store::constants_history(const std::string& serial) {
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*database_));
  const std::vector<Value> unit = {serial};
  UnitHistory all;
  SIXPOINT_ASSIGN(all.constants, select<ConstantsRecord>("WHERE serial = $1 ORDER BY seq", unit));
  SIXPOINT_ASSIGN(all.corrections,
                  select<Correction>("WHERE about_table = 'constants' AND about_id IN (SELECT id "
                                     "FROM constants WHERE serial = $1) ORDER BY seq",
                                     unit));
  return all;
}

Result<std::vector<ConstantsRecord>> Store::history(const std::string& serial) {
  return select<ConstantsRecord>("WHERE serial = $1 ORDER BY seq", std::vector<Value>{serial});
}

Result<RunRecord> Store::run(const std::string& given) {
  SIXPOINT_ASSIGN(const std::string id, whole_key("runs", given));
  SIXPOINT_ASSIGN(auto found, select<RunRecord>("WHERE id = $1", std::vector<Value>{id}));
  SIXPOINT_ASSIGN(found.at(0).head, head_of_run(id));
  return std::move(found[0]);
}

Result<std::string> Store::head_of_run(const std::string& id) {
  SIXPOINT_ASSIGN(const auto found,
                  database_->query("SELECT hash FROM runs WHERE id = $1", std::vector<Value>{id}));
  const auto* hash = found.empty() ? nullptr : std::get_if<Bytes>(&found[0][0]);
  if (hash == nullptr) {
    return fail(ErrorCode::no_input, fmt::format("no run '{}'", printable(id, 60)),
                database_->location(), "'sixpoint history SERIAL' lists the runs of a unit");
  }
  return to_hex(*hash);
}

Result<std::optional<RepairRecord>> Store::repair_of_output(const std::string& output_sha256) {
  // "+ 0": a planner without statistics would rather walk back along seq through millions of rows
  // than sort the one or two that the hash has.
  SIXPOINT_ASSIGN(const auto found,
                  select<RepairRecord>("WHERE output_sha256 = $1 ORDER BY seq + 0 DESC LIMIT 1",
                                       std::vector<Value>{output_sha256}));
  return found.empty() ? std::nullopt : std::optional(found[0]);
}

}  // namespace sixpoint::db
