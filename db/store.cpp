#include "db/store.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "db/chain.h"
#include "db/schema.h"

namespace sixpoint::db {
namespace {

constexpr std::size_t kLongestName = 200;
constexpr std::size_t kMostFindings = 20;

std::int64_t to_ns(UtcTime time) { return time.time_since_epoch().count(); }
UtcTime from_ns(std::int64_t ns) { return UtcTime(std::chrono::nanoseconds(ns)); }

Value optional_text(const std::string& text) {
  return text.empty() ? Value(std::monostate{}) : Value(text);
}

std::string text_of(const Value& value) {
  const auto* text = std::get_if<std::string>(&value);
  return text == nullptr ? std::string() : *text;
}

std::int64_t integer_of(const Value& value) {
  const auto* integer = std::get_if<std::int64_t>(&value);
  return integer == nullptr ? 0 : *integer;
}

// Serial numbers are keys for good: one that a person can't read or type is refused, not mangled.
Status check_serial(const std::string& serial) {
  if (serial.empty() || serial.size() > kLongestName || printable(serial) != serial) {
    return fail(ErrorCode::bad_data, fmt::format("'{}' is no serial number", printable(serial, 40)),
                {}, fmt::format("a serial number has 1 to {} printable characters", kLongestName));
  }
  return {};
}

Status check_filter(const std::string& filter) {
  if (filter != "legacy" && filter != "current") {
    return fail(ErrorCode::bad_data,
                fmt::format("'{}' is no filter configuration", printable(filter, 40)), {},
                "it is 'legacy' or 'current'");
  }
  return {};
}

Status check_json(const std::string& document) {
  if (!nlohmann::json::accept(document)) {
    return fail(ErrorCode::bad_data, "the document is no JSON", {}, "please report this");
  }
  return {};
}

std::string column_list(const Table& table) {
  std::string list = "seq";
  for (const Column& column : table.columns) {
    list += fmt::format(", {}", column.name);
  }
  return list + ", hash";
}

// The content's own name. `values` without the leading id.
std::string identifier(std::string_view table, std::span<const Value> values) {
  const Sha256Digest digest = chain_hash({}, table, 0, values);
  return to_hex(std::span(digest).first(16));
}

constexpr std::string_view kConstantsColumns =
    "id, made_at_ns, serial, filter, method, run_id, document";

ConstantsRecord to_constants(const Row& row) {
  return {text_of(row[0]), from_ns(integer_of(row[1])),
          text_of(row[2]), text_of(row[3]),
          text_of(row[4]), text_of(row[5]),
          text_of(row[6])};
}

}  // namespace

std::string AuditReport::brief() const {
  return ok ? fmt::format("{} rows, nothing touched, head {}", rows, head)
            : fmt::format("{} rows, {} findings, the first: {}", rows, findings.size(),
                          findings.empty() ? "" : findings.front());
}

nlohmann::ordered_json AuditReport::to_json() const {
  return {{"ok", ok}, {"rows", rows}, {"head", head}, {"findings", findings}};
}

struct Store::Impl {
  Env& env;
  std::unique_ptr<Database> database;

  // Runs `work` in one transaction; nothing of it stays when it fails.
  template <class Work>
  Status in_transaction(Work&& work) {
    SIXPOINT_CHECK(database->begin_writing());
    Status status = work();
    if (status) {
      status = database->commit();
    }
    if (!status) {
      database->roll_back();
    }
    return status;
  }

  // Appends one row to the history, inside a transaction. A row whose key is there is left alone
  // when its content is the same.
  Status append(std::string_view name, std::span<const Value> values) {
    const Table& into = table(name);
    const std::vector<Value> key = {values[0]};
    SIXPOINT_ASSIGN(
        const auto there,
        database->query(fmt::format("SELECT seq FROM {} WHERE {} = $1", name, into.columns[0].name),
                        key));
    if (!there.empty()) {
      return {};
    }
    SIXPOINT_ASSIGN(const auto head, database->query("SELECT rows, hash FROM head"));
    if (head.size() != 1) {
      return fail(ErrorCode::bad_data, "the head of the history is missing", database->location(),
                  "restore the last backup");
    }
    const std::int64_t seq = integer_of(head[0][0]) + 1;
    const Sha256Digest hash = chain_hash(std::get<Bytes>(head[0][1]), name, seq, values);
    std::vector<Value> row = {Value(seq)};
    row.insert(row.end(), values.begin(), values.end());
    row.emplace_back(Bytes(hash.begin(), hash.end()));
    std::string places;
    for (std::size_t i = 1; i <= row.size(); ++i) {
      places += fmt::format("{}${}", i == 1 ? "" : ", ", i);
    }
    SIXPOINT_CHECK(database->execute(
        fmt::format("INSERT INTO {} ({}) VALUES ({})", name, column_list(into), places), row));
    const std::vector<Value> new_head = {Value(seq), row.back()};
    return database->execute("UPDATE head SET rows = $1, hash = $2 WHERE one = 1", new_head);
  }

  Status append_unit(const std::string& serial, const std::string& model) {
    return append("units", std::vector<Value>{serial, model, to_ns(env.clock.now())});
  }
};

Store::Store(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;
Store::~Store() = default;

Result<Store> Store::open(Env& env, const std::string& location) {
  if (location.starts_with("postgresql://") || location.starts_with("postgres://")) {
    return fail(ErrorCode::usage, "PostgreSQL stores are not built yet", {},
                "name an SQLite file with --store");
  }
  SIXPOINT_ASSIGN(auto database, open_sqlite(location));
  SIXPOINT_CHECK(migrate(*database));
  return Store(std::unique_ptr<Impl>(new Impl{env, std::move(database)}));
}

Result<std::string> Store::add_constants(const ConstantsRecord& record, const std::string& model) {
  SIXPOINT_CHECK(check_serial(record.serial));
  SIXPOINT_CHECK(check_filter(record.filter));
  SIXPOINT_CHECK(check_json(record.document));
  std::vector<Value> values = {record.serial,
                               record.filter,
                               to_ns(record.made_at),
                               record.method,
                               optional_text(record.run_id),
                               record.document};
  const std::string id = identifier("constants", values);
  values.insert(values.begin(), Value(id));
  SIXPOINT_CHECK(impl_->in_transaction([&]() -> Status {
    SIXPOINT_CHECK(impl_->append_unit(record.serial, model));
    return impl_->append("constants", values);
  }));
  return id;
}

Result<std::string> Store::add_run(const RunRecord& run, const std::vector<Capture>& captures) {
  SIXPOINT_CHECK(check_serial(run.serial));
  SIXPOINT_CHECK(check_filter(run.filter));
  SIXPOINT_CHECK(check_json(run.document));
  std::vector<Value> values = {run.serial,
                               run.kind,
                               run.filter,
                               to_ns(run.started),
                               to_ns(run.ended),
                               run.operator_name,
                               run.station,
                               run.jig,
                               run.verdict,
                               run.software,
                               optional_text(run.retest_of),
                               run.document};
  const std::string id = identifier("runs", values);
  values.insert(values.begin(), Value(id));
  SIXPOINT_CHECK(impl_->in_transaction([&]() -> Status {
    SIXPOINT_CHECK(impl_->append_unit(run.serial, run.model));
    SIXPOINT_CHECK(impl_->append("runs", values));
    for (const Capture& capture : captures) {
      const std::string hash = to_hex(sha256(capture.bytes));
      const std::vector<Value> name = {hash};
      SIXPOINT_ASSIGN(const auto there,
                      impl_->database->query("SELECT 1 FROM attachments WHERE sha256 = $1", name));
      if (there.empty()) {
        const std::vector<Value> attachment = {hash, capture.bytes};
        SIXPOINT_CHECK(
            impl_->database->execute("INSERT INTO attachments VALUES ($1, $2)", attachment));
      }
      std::vector<Value> row = {id, capture.name, hash};
      row.insert(row.begin(), Value(identifier("captures", row)));
      SIXPOINT_CHECK(impl_->append("captures", row));
    }
    return {};
  }));
  return id;
}

Result<std::string> Store::add_unit_write(const UnitWrite& write) {
  SIXPOINT_CHECK(check_serial(write.serial));
  std::vector<Value> values = {write.run_id,   write.serial,  to_ns(write.written),
                               write.as_found, write.as_left, write.read_back};
  const std::string id = identifier("unit_writes", values);
  values.insert(values.begin(), Value(id));
  SIXPOINT_CHECK(impl_->in_transaction([&] { return impl_->append("unit_writes", values); }));
  return id;
}

Result<std::string> Store::add_repair(const RepairRecord& repair) {
  SIXPOINT_CHECK(check_serial(repair.serial));
  SIXPOINT_CHECK(check_json(repair.document));
  std::vector<Value> values = {repair.serial,
                               to_ns(repair.made_at),
                               repair.input,
                               repair.input_sha256,
                               repair.output_sha256,
                               repair.method,
                               optional_text(repair.constants_id),
                               repair.document};
  const std::string id = identifier("repairs", values);
  values.insert(values.begin(), Value(id));
  SIXPOINT_CHECK(impl_->in_transaction([&] { return impl_->append("repairs", values); }));
  return id;
}

Status Store::withdraw_constants(const std::string& id, const std::string& operator_name,
                                 const std::string& reason) {
  const std::vector<Value> key = {id};
  SIXPOINT_ASSIGN(const auto there,
                  impl_->database->query("SELECT id FROM constants WHERE id = $1", key));
  if (there.empty()) {
    return fail(ErrorCode::no_input, fmt::format("no constants '{}'", printable(id, 60)),
                impl_->database->location(), "'sixpoint history SERIAL' lists them");
  }
  if (reason.empty()) {
    return fail(ErrorCode::usage, "a withdrawal needs a reason", {}, "say why");
  }
  std::vector<Value> values = {
      to_ns(impl_->env.clock.now()), "constants", id, "withdraw", operator_name, reason};
  values.insert(values.begin(), Value(identifier("corrections", values)));
  return impl_->in_transaction([&] { return impl_->append("corrections", values); });
}

Result<std::optional<ConstantsRecord>> Store::constants_for(const std::string& serial,
                                                            const std::string& filter) {
  const std::vector<Value> parameters = {serial, filter};
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          fmt::format("SELECT {} FROM constants WHERE serial = $1 AND filter = $2 "
                      "AND NOT EXISTS (SELECT 1 FROM corrections WHERE about_table = 'constants' "
                      "AND about_id = constants.id AND action = 'withdraw') "
                      "ORDER BY made_at_ns DESC, seq DESC LIMIT 1",
                      kConstantsColumns),
          parameters));
  if (rows.empty()) {
    return std::nullopt;
  }
  return to_constants(rows[0]);
}

Result<std::vector<ConstantsRecord>> Store::history(const std::string& serial) {
  const std::vector<Value> parameters = {serial};
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          fmt::format("SELECT {} FROM constants WHERE serial = $1 ORDER BY seq", kConstantsColumns),
          parameters));
  std::vector<ConstantsRecord> records;
  std::transform(rows.begin(), rows.end(), std::back_inserter(records), to_constants);
  return records;
}

Result<std::vector<UnitRecord>> Store::units() {
  SIXPOINT_ASSIGN(const auto rows,
                  impl_->database->query(
                      "SELECT serial, model, first_seen_ns, "
                      "(SELECT count(*) FROM constants WHERE constants.serial = units.serial) "
                      "FROM units ORDER BY serial"));
  std::vector<UnitRecord> records;
  records.reserve(rows.size());
  for (const Row& row : rows) {
    records.push_back({text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
                       static_cast<std::size_t>(integer_of(row[3]))});
  }
  return records;
}

Result<std::optional<RepairRecord>> Store::repair_of_output(const std::string& output_sha256) {
  const std::vector<Value> parameters = {output_sha256};
  SIXPOINT_ASSIGN(const auto rows,
                  impl_->database->query(
                      "SELECT id, serial, made_at_ns, input, input_sha256, output_sha256, method, "
                      "constants_id, document FROM repairs WHERE output_sha256 = $1 "
                      "ORDER BY seq DESC LIMIT 1",
                      parameters));
  if (rows.empty()) {
    return std::nullopt;
  }
  const Row& row = rows[0];
  return RepairRecord{text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
                      text_of(row[3]), text_of(row[4]), text_of(row[5]),
                      text_of(row[6]), text_of(row[7]), text_of(row[8])};
}

Result<AuditReport> Store::audit() {
  AuditReport report;
  const auto find = [&](std::string finding) {
    if (report.findings.size() < kMostFindings) {
      report.findings.push_back(std::move(finding));
    }
  };
  Database& database = *impl_->database;

  // Attachments are named by their content.
  {
    SIXPOINT_ASSIGN(const auto rows, database.stream("SELECT sha256, bytes FROM attachments"));
    Row row;
    while (true) {
      SIXPOINT_ASSIGN(const bool more, rows->next(row));
      if (!more) {
        break;
      }
      const auto* bytes = std::get_if<Bytes>(&row[1]);
      if (bytes == nullptr || to_hex(sha256(*bytes)) != text_of(row[0])) {
        find(fmt::format("attachment {} was changed", text_of(row[0])));
      }
    }
  }

  // All tables are read in step, always the row with the lowest seq next.
  struct Cursor {
    std::string_view table;
    std::unique_ptr<RowStream> rows;
    Row row;
    bool more = false;
  };
  std::vector<Cursor> cursors;
  for (const Table& table : tables()) {
    SIXPOINT_ASSIGN(auto rows, database.stream(fmt::format("SELECT {} FROM {} ORDER BY seq",
                                                           column_list(table), table.name)));
    Cursor cursor{table.name, std::move(rows), {}, false};
    SIXPOINT_ASSIGN(cursor.more, cursor.rows->next(cursor.row));
    cursors.push_back(std::move(cursor));
  }
  Bytes previous(32, 0);
  std::int64_t expected = 1;
  while (true) {
    Cursor* first = nullptr;
    for (Cursor& cursor : cursors) {
      if (cursor.more &&
          (first == nullptr || integer_of(cursor.row[0]) < integer_of(first->row[0]))) {
        first = &cursor;
      }
    }
    if (first == nullptr) {
      break;
    }
    const std::int64_t seq = integer_of(first->row[0]);
    if (seq != expected) {
      find(seq > expected ? fmt::format("rows {} to {} are missing", expected, seq - 1)
                          : fmt::format("row {} is there twice", seq));
    }
    const auto* stored = std::get_if<Bytes>(&first->row.back());
    const auto columns = std::span<const Value>(first->row).subspan(1, first->row.size() - 2);
    const Sha256Digest hash = chain_hash(previous, first->table, seq, columns);
    if (stored == nullptr ||
        !std::equal(hash.begin(), hash.end(), stored->begin(), stored->end())) {
      find(fmt::format("row {} ({} {}) does not fit the chain: it, or one before it, was changed",
                       seq, first->table, text_of(first->row[1])));
    }
    // Go on from what is written, so that one changed row is one finding and not all that follow.
    if (stored != nullptr) {
      previous = *stored;
    }
    expected = seq + 1;
    ++report.rows;
    SIXPOINT_ASSIGN(first->more, first->rows->next(first->row));
  }
  SIXPOINT_ASSIGN(const auto head, database.query("SELECT rows, hash FROM head"));
  const auto* head_hash = head.size() == 1 ? std::get_if<Bytes>(&head[0][1]) : nullptr;
  if (head_hash == nullptr || integer_of(head[0][0]) != expected - 1 || *head_hash != previous) {
    find("the head does not name the last row: rows at the end were removed or added");
  }
  report.head = to_hex(previous);
  report.ok = report.findings.empty();
  return report;
}

}  // namespace sixpoint::db
