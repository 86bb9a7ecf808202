#include "db/store.h"

#include <algorithm>
#include <limits>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "db/chain.h"
#include "db/hex.h"
#include "db/history.h"
#include "db/schema.h"

namespace sixpoint::db {
namespace {

constexpr std::size_t kLongestName = 200;
constexpr std::size_t kMostFindings = 20;
// PostgreSQL takes 1 GiB, and an export writes twice as many hex digits on one line.
constexpr std::size_t kLargestCapture = 100U << 20;
constexpr std::size_t kLargestDocument = 64U << 20;

std::int64_t to_ns(UtcTime time) { return time.time_since_epoch().count(); }
UtcTime from_ns(std::int64_t ns) { return UtcTime(std::chrono::nanoseconds(ns)); }

// UTF-8 as RFC 3629 has it, without NUL: what both servers keep as it is.
bool is_storable(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead == 0      ? 0
                               : lead < 0x80  ? 1
                               : lead < 0xC2  ? 0
                               : lead < 0xE0  ? 2
                               : lead < 0xF0  ? 3
                               : lead <= 0xF4 ? 4
                                              : 0;
    if (length == 0 || i + length > text.size()) {
      return false;
    }
    for (std::size_t k = 1; k < length; ++k) {
      const auto byte = static_cast<unsigned char>(text[i + k]);
      // The second byte rules out overlong forms, surrogates and what lies above U+10FFFF.
      const unsigned low = k > 1 ? 0x80 : lead == 0xE0 ? 0xA0 : lead == 0xF0 ? 0x90 : 0x80;
      const unsigned high = k > 1 ? 0xBF : lead == 0xED ? 0x9F : lead == 0xF4 ? 0x8F : 0xBF;
      if (byte < low || byte > high) {
        return false;
      }
    }
    i += length;
  }
  return true;
}

Status check_texts(std::initializer_list<std::string_view> texts,
                   std::size_t limit = kLongestName) {
  for (const std::string_view text : texts) {
    if (text.size() > limit || !is_storable(text)) {
      return fail(ErrorCode::bad_data,
                  fmt::format("'{}' cannot be kept as a text", printable(text, 40)), {},
                  fmt::format("the store keeps up to {} bytes of UTF-8 there", limit));
    }
  }
  return {};
}

// Serial numbers are keys for good: one that a person can't read or type is refused, not mangled.
Status check_serial(const std::string& serial) {
  if (serial.empty() || serial.size() > kLongestName || printable(serial) != serial ||
      !is_storable(serial)) {
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
  if (document.size() > kLargestDocument || !nlohmann::json::accept(document)) {
    return fail(ErrorCode::bad_data, "the document is no JSON", {}, "please report this");
  }
  return {};
}

std::string identifier(std::string_view name, std::span<const Value> values) {
  return ChainHasher().identifier(table(name), values);
}

// A member of a JSON document as text, or NULL.
Value member_of(const nlohmann::ordered_json& document, const char* key) {
  if (!document.is_object() || !document.contains(key) || document[key].is_null()) {
    return std::monostate{};
  }
  return document[key].dump();
}

Value number_text(const std::optional<double>& number) {
  return number ? Value(nlohmann::json(*number).dump()) : Value(std::monostate{});
}

constexpr std::string_view kLegacyMeaning =
    "the sensor's filter as firmware before 2014-03-24 set it";
constexpr std::string_view kCurrentMeaning =
    "the sensor's filter as firmware sets it since 2014-03-24";

// The records as rows of their tables, checked, with their ids in front.
Row with_id(std::string_view table, Row values) {
  values.insert(values.begin(), Value(identifier(table, values)));
  return values;
}

Result<Row> row_of(const ConstantsRecord& record) {
  SIXPOINT_CHECK(check_serial(record.serial));
  SIXPOINT_CHECK(check_filter(record.filter));
  SIXPOINT_CHECK(check_json(record.document));
  SIXPOINT_CHECK(check_texts({record.method, record.run_id}));
  Row row = with_id("constants", {record.serial, record.filter, to_ns(record.made_at),
                                  record.method, optional_text(record.run_id), record.document});
  // Not part of the name: they are in the document, which is.
  const auto document = nlohmann::ordered_json::parse(record.document);
  row.push_back(member_of(document, "standard_uncertainty"));
  row.push_back(member_of(document, "made_from"));
  return row;
}

Status check_captures(const std::vector<Capture>& captures) {
  for (const Capture& capture : captures) {
    SIXPOINT_CHECK(check_texts({capture.name}));
    if (capture.bytes.size() > kLargestCapture) {
      return fail(ErrorCode::bad_data,
                  fmt::format("the capture {} has {} bytes", printable(capture.name, 60),
                              capture.bytes.size()),
                  {}, fmt::format("the store keeps up to {} bytes", kLargestCapture));
    }
  }
  return {};
}

Result<Row> row_of(const RunRecord& run) {
  SIXPOINT_CHECK(check_serial(run.serial));
  SIXPOINT_CHECK(check_filter(run.filter));
  SIXPOINT_CHECK(check_json(run.document));
  SIXPOINT_CHECK(check_texts({run.model, run.kind, run.operator_name, run.station, run.jig,
                              run.verdict, run.software, run.retest_of, run.build}));
  if (!run.limits.empty()) {
    SIXPOINT_CHECK(check_json(run.limits));
  }
  for (const std::string& code : run.codes) {
    SIXPOINT_CHECK(check_texts({code}, 10 * kLongestName));
  }
  return with_id(
      "runs",
      {run.serial, run.kind, run.filter, to_ns(run.started), to_ns(run.ended), run.operator_name,
       run.station, run.jig, run.verdict, run.software, optional_text(run.retest_of), run.document,
       run.jig_due ? Value(to_ns(*run.jig_due)) : Value(), optional_text(run.build),
       optional_text(run.limits), number_text(run.gravity_m_per_s2), number_text(run.temperature_c),
       run.codes.empty() ? Value() : Value(nlohmann::json(run.codes).dump())});
}

Result<Row> row_of(const UnitWrite& write) {
  SIXPOINT_CHECK(check_serial(write.serial));
  SIXPOINT_CHECK(check_texts({write.run_id}));
  SIXPOINT_CHECK(check_texts({write.as_found, write.as_left, write.read_back}, kLargestDocument));
  return with_id("unit_writes", {write.run_id, write.serial, to_ns(write.written), write.as_found,
                                 write.as_left, write.read_back});
}

Result<Row> row_of(const RepairRecord& repair) {
  SIXPOINT_CHECK(check_serial(repair.serial));
  SIXPOINT_CHECK(check_json(repair.document));
  SIXPOINT_CHECK(check_texts({repair.input_sha256, repair.output_sha256, repair.method,
                              repair.constants_id, repair.software}));
  return with_id("repairs", {repair.serial, to_ns(repair.made_at), storable_path(repair.input),
                             repair.input_sha256, repair.output_sha256, repair.method,
                             optional_text(repair.constants_id), repair.document,
                             optional_text(repair.software)});
}

constexpr std::string_view kConstantsColumns =
    "constants.id, constants.made_at_ns, constants.serial, constants.filter, constants.method, "
    "constants.run_id, constants.document, constants.standard_uncertainty, constants.origin";
constexpr std::size_t kConstantsColumnCount = 9;
constexpr std::string_view kRepairColumns =
    "repairs.id, repairs.serial, repairs.made_at_ns, repairs.input, repairs.input_sha256, "
    "repairs.output_sha256, repairs.method, repairs.constants_id, repairs.document, "
    "repairs.software";
constexpr std::size_t kRepairColumnCount = 10;

constexpr std::string_view kRunColumns =
    "id, serial, kind, filter, started_ns, ended_ns, operator, station, jig, verdict, software, "
    "retest_of, document, jig_due_ns, build, limits, gravity_m_per_s2, temperature_c, codes";

// The withdrawals w that nobody has taken back; of one set of constants, and of any.
constexpr std::string_view kStillWithdrawn =
    "w.about_table = 'constants' AND w.action = 'withdraw' AND NOT EXISTS (SELECT 1 FROM "
    "corrections r WHERE r.about_table = 'constants' AND r.about_id = w.about_id "
    "AND r.action = 'reinstate' AND r.seq > w.seq)";
std::string not_withdrawn() {
  return fmt::format(
      "NOT EXISTS (SELECT 1 FROM corrections w WHERE w.about_id = constants.id AND {})",
      kStillWithdrawn);
}

ConstantsRecord to_constants(const Row& row) {
  return {text_of(row[0]), from_ns(integer_of(row[1])),
          text_of(row[2]), text_of(row[3]),
          text_of(row[4]), text_of(row[5]),
          text_of(row[6]), text_of(row[7]),
          text_of(row[8])};
}

std::optional<double> number_of(const Value& value) {
  const auto json = nlohmann::json::parse(text_of(value), nullptr, false);
  return json.is_number() ? std::optional(json.get<double>()) : std::nullopt;
}

RunRecord to_run(const Row& row) {
  RunRecord run;
  run.id = text_of(row[0]);
  run.serial = text_of(row[1]);
  run.kind = text_of(row[2]);
  run.filter = text_of(row[3]);
  run.started = from_ns(integer_of(row[4]));
  run.ended = from_ns(integer_of(row[5]));
  run.operator_name = text_of(row[6]);
  run.station = text_of(row[7]);
  run.jig = text_of(row[8]);
  run.verdict = text_of(row[9]);
  run.software = text_of(row[10]);
  run.retest_of = text_of(row[11]);
  run.document = text_of(row[12]);
  if (!std::holds_alternative<std::monostate>(row[13])) {
    run.jig_due = from_ns(integer_of(row[13]));
  }
  run.build = text_of(row[14]);
  run.limits = text_of(row[15]);
  run.gravity_m_per_s2 = number_of(row[16]);
  run.temperature_c = number_of(row[17]);
  const auto codes = nlohmann::json::parse(text_of(row[18]), nullptr, false);
  for (const auto& code : codes.is_array() ? codes : nlohmann::json::array()) {
    run.codes.push_back(code.is_string() ? code.get<std::string>() : code.dump());
  }
  return run;
}

RepairRecord to_repair(const Row& row) {
  return {text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
          text_of(row[3]), text_of(row[4]), text_of(row[5]),
          text_of(row[6]), text_of(row[7]), text_of(row[8]),
          text_of(row[9])};
}

}  // namespace

// The name of a file may be any bytes; it is evidence, so it is written down in a form that can be
// kept rather than refused.
std::string storable_path(std::string_view path) {
  if (is_storable(path)) {
    return std::string(path);
  }
  std::string text;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    text += byte >= 0x20 && byte < 0x7F ? std::string(1, c) : fmt::format("\\x{:02x}", byte);
  }
  return text;
}

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

  // Runs `work(writer)` in one transaction; nothing of it stays when it fails.
  template <class Work>
  Status in_transaction(Work&& work) {
    SIXPOINT_ASSIGN(auto transaction, Transaction::writing(*database));
    SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(*database));
    const std::int64_t before = writer.head().rows;
    SIXPOINT_CHECK(work(writer));
    if (writer.head().rows == before) {
      return {};
    }
    SIXPOINT_CHECK(writer.finish());
    return transaction.commit();
  }

  // Appends one row. A row whose key is there is left alone: its key names its content.
  Status append(HistoryWriter& writer, std::string_view name, std::span<const Value> values) {
    const Table& into = table(name);
    SIXPOINT_ASSIGN(
        const auto there,
        database->query(fmt::format("SELECT seq FROM {} WHERE {} = $1", name, into.columns[0].name),
                        values.first(1)));
    return there.empty() ? writer.append(into, values) : Status();
  }

  Status append_unit(HistoryWriter& writer, const std::string& serial, const std::string& model,
                     UtcTime seen) {
    return append(writer, "units", std::vector<Value>{serial, model, to_ns(seen)});
  }

  Status append_filter(HistoryWriter& writer, const std::string& filter) {
    return append(writer, "filter_configurations",
                  std::vector<Value>{
                      filter, std::string(filter == "legacy" ? kLegacyMeaning : kCurrentMeaning)});
  }
};

Store::Store(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;
Store::~Store() = default;

Result<Store> Store::open(Env& env, const std::string& location) {
  const bool postgres =
      location.starts_with("postgresql://") || location.starts_with("postgres://");
  SIXPOINT_ASSIGN(auto database, postgres ? open_postgres(location) : open_sqlite(location));
  SIXPOINT_CHECK(migrate(*database));
  return Store(std::unique_ptr<Impl>(new Impl{env, std::move(database)}));
}

Database& Store::database() { return *impl_->database; }

Result<std::string> id_of(const ConstantsRecord& record) {
  SIXPOINT_ASSIGN(const auto row, row_of(record));
  return text_of(row[0]);
}

Result<std::string> id_of(const RunRecord& run, const std::vector<Capture>& captures) {
  SIXPOINT_CHECK(check_captures(captures));
  SIXPOINT_ASSIGN(const auto row, row_of(run));
  return text_of(row[0]);
}

Result<std::string> id_of(const UnitWrite& write) {
  SIXPOINT_ASSIGN(const auto row, row_of(write));
  return text_of(row[0]);
}

Result<std::string> id_of(const RepairRecord& repair) {
  SIXPOINT_ASSIGN(const auto row, row_of(repair));
  return text_of(row[0]);
}

Result<std::string> Store::add_constants(const ConstantsRecord& record, const std::string& model) {
  SIXPOINT_CHECK(check_texts({model}));
  SIXPOINT_ASSIGN(const auto values, row_of(record));
  SIXPOINT_CHECK(impl_->in_transaction([&](HistoryWriter& writer) -> Status {
    SIXPOINT_CHECK(impl_->append_unit(writer, record.serial, model, record.made_at));
    SIXPOINT_CHECK(impl_->append_filter(writer, record.filter));
    return impl_->append(writer, "constants", values);
  }));
  return text_of(values[0]);
}

Result<std::string> Store::add_run(const RunRecord& run, const std::vector<Capture>& captures) {
  SIXPOINT_CHECK(check_captures(captures));
  SIXPOINT_ASSIGN(const auto values, row_of(run));
  const std::string id = text_of(values[0]);
  SIXPOINT_CHECK(impl_->in_transaction([&](HistoryWriter& writer) -> Status {
    SIXPOINT_CHECK(impl_->append_unit(writer, run.serial, run.model, run.started));
    SIXPOINT_CHECK(impl_->append_filter(writer, run.filter));
    SIXPOINT_CHECK(impl_->append(writer, "runs", values));
    for (const Capture& capture : captures) {
      const std::string hash = to_hex(sha256(capture.bytes));
      SIXPOINT_CHECK(writer.add_attachment(hash, capture.bytes));
      const Row row = with_id("captures", {id, capture.name, hash});
      SIXPOINT_CHECK(impl_->append(writer, "captures", row));
    }
    return {};
  }));
  return id;
}

Result<std::string> Store::add_unit_write(const UnitWrite& write) {
  SIXPOINT_ASSIGN(const auto values, row_of(write));
  SIXPOINT_CHECK(impl_->in_transaction(
      [&](HistoryWriter& writer) { return impl_->append(writer, "unit_writes", values); }));
  return text_of(values[0]);
}

Result<std::string> Store::add_repair(const RepairRecord& repair) {
  SIXPOINT_ASSIGN(const auto values, row_of(repair));
  SIXPOINT_CHECK(impl_->in_transaction(
      [&](HistoryWriter& writer) { return impl_->append(writer, "repairs", values); }));
  return text_of(values[0]);
}

Result<std::string> Store::correct(const Correction& correction) {
  SIXPOINT_CHECK(check_texts({correction.row_id, correction.operator_name}));
  SIXPOINT_CHECK(check_texts({correction.reason}, 100 * kLongestName));
  const Table* about = find_table(correction.table);
  if (about == nullptr) {
    std::string names;
    for (const Table& known : tables()) {
      names += fmt::format(" {}", known.name);
    }
    return fail(ErrorCode::usage, fmt::format("no table '{}'", printable(correction.table, 60)), {},
                "there are:" + names);
  }
  const bool of_constants = correction.action == "withdraw" || correction.action == "reinstate";
  if ((!of_constants && correction.action != "note") ||
      (of_constants && correction.table != "constants")) {
    return fail(
        ErrorCode::usage,
        fmt::format("no correction '{}' of {}", printable(correction.action, 60), correction.table),
        {}, "constants are withdrawn and reinstated; any row can have a note");
  }
  if (correction.reason.empty()) {
    return fail(ErrorCode::usage, "a correction needs a reason", {}, "say why");
  }
  const std::vector<Value> key = {correction.row_id};
  SIXPOINT_ASSIGN(const auto there,
                  impl_->database->query(fmt::format("SELECT seq FROM {} WHERE {} = $1",
                                                     about->name, about->columns[0].name),
                                         key));
  if (there.empty()) {
    return fail(ErrorCode::no_input,
                fmt::format("no {} '{}'", correction.table, printable(correction.row_id, 60)),
                impl_->database->location(), "'sixpoint history SERIAL' lists them");
  }
  const Row values =
      with_id("corrections", {to_ns(impl_->env.clock.now()), correction.table, correction.row_id,
                              correction.action, correction.operator_name, correction.reason});
  SIXPOINT_CHECK(impl_->in_transaction(
      [&](HistoryWriter& writer) { return impl_->append(writer, "corrections", values); }));
  return text_of(values[0]);
}

Status Store::withdraw_constants(const std::string& id, const std::string& operator_name,
                                 const std::string& reason) {
  Correction correction;
  correction.table = "constants";
  correction.row_id = id;
  correction.action = "withdraw";
  correction.operator_name = operator_name;
  correction.reason = reason;
  SIXPOINT_CHECK(correct(correction));
  return {};
}

bool UnitHistory::empty() const {
  return constants.empty() && runs.empty() && writes.empty() && repairs.empty() &&
         corrections.empty();
}

bool UnitHistory::is_withdrawn(const std::string& constants_id) const {
  bool withdrawn = false;
  for (const Correction& correction : corrections) {
    if (correction.table == "constants" && correction.row_id == constants_id &&
        correction.action != "note") {
      withdrawn = correction.action == "withdraw";
    }
  }
  return withdrawn;
}

Result<UnitHistory> Store::unit_history(const std::string& serial) {
  // One moment: a run and the constants that it made belong together.
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*impl_->database));
  const std::vector<Value> parameters = {serial};
  UnitHistory all;
  const auto read = [&](std::string_view columns, std::string_view table, auto& into,
                        auto convert) -> Status {
    SIXPOINT_ASSIGN(const auto rows,
                    impl_->database->query(fmt::format("SELECT {} FROM {} WHERE serial = $1 "
                                                       "ORDER BY seq",
                                                       columns, table),
                                           parameters));
    std::transform(rows.begin(), rows.end(), std::back_inserter(into), convert);
    return {};
  };
  SIXPOINT_CHECK(read(kConstantsColumns, "constants", all.constants, to_constants));
  SIXPOINT_CHECK(read(kRunColumns, "runs", all.runs, to_run));
  SIXPOINT_CHECK(read("run_id, serial, written_ns, as_found, as_left, read_back", "unit_writes",
                      all.writes, [](const Row& row) {
                        return UnitWrite{
                            text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
                            text_of(row[3]), text_of(row[4]), text_of(row[5])};
                      }));
  SIXPOINT_CHECK(read(kRepairColumns, "repairs", all.repairs, to_repair));
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          "SELECT id, made_at_ns, about_table, about_id, action, operator, reason FROM corrections "
          "WHERE (about_table = 'units' AND about_id = $1) "
          "OR (about_table = 'constants' AND about_id IN (SELECT id FROM constants WHERE serial = "
          "$1)) "
          "OR (about_table = 'runs' AND about_id IN (SELECT id FROM runs WHERE serial = $1)) "
          "OR (about_table = 'unit_writes' AND about_id IN (SELECT id FROM unit_writes WHERE "
          "serial = $1)) "
          "OR (about_table = 'repairs' AND about_id IN (SELECT id FROM repairs WHERE serial = $1)) "
          "ORDER BY seq",
          parameters));
  for (const Row& row : rows) {
    all.corrections.push_back({text_of(row[0]), from_ns(integer_of(row[1])), text_of(row[2]),
                               text_of(row[3]), text_of(row[4]), text_of(row[5]), text_of(row[6])});
  }
  return all;
}

Result<RunRecord> Store::run(const std::string& id) {
  const std::vector<Value> parameters = {id};
  SIXPOINT_ASSIGN(const auto rows,
                  impl_->database->query(
                      fmt::format("SELECT {} FROM runs WHERE id = $1", kRunColumns), parameters));
  if (rows.empty()) {
    return fail(ErrorCode::no_input, fmt::format("no run '{}'", printable(id, 60)),
                impl_->database->location(), "'sixpoint history SERIAL' lists the runs of a unit");
  }
  return to_run(rows[0]);
}

Result<std::string> Store::add_station_event(const StationEvent& event) {
  SIXPOINT_CHECK(check_texts({event.station, event.operator_name}));
  SIXPOINT_CHECK(check_texts({event.reason}, 100 * kLongestName));
  const bool about_unit =
      event.action == "check_unit" || event.action == "check_unit_end" || event.action == "release";
  if (!about_unit && event.action != "sign" && event.action != "sign_new_baseline") {
    return fail(ErrorCode::usage,
                fmt::format("nothing at a station is called '{}'", printable(event.action, 60)), {},
                "please report this");
  }
  if (about_unit) {
    SIXPOINT_CHECK(check_serial(event.serial));
  }
  if (event.operator_name.empty() || event.reason.empty()) {
    return fail(ErrorCode::usage, "a decision needs a name and a reason", {},
                "say who decides, and why");
  }
  const Row values =
      with_id("station_events", {to_ns(impl_->env.clock.now()), event.station, event.serial,
                                 event.action, event.operator_name, event.reason});
  SIXPOINT_CHECK(impl_->in_transaction(
      [&](HistoryWriter& writer) { return impl_->append(writer, "station_events", values); }));
  return text_of(values[0]);
}

Result<std::vector<StationEvent>> Store::station_events(const std::string& station) {
  std::vector<Value> parameters;
  if (!station.empty()) {
    parameters.emplace_back(station);
  }
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          fmt::format("SELECT id, made_at_ns, station, serial, action, operator, reason "
                      "FROM station_events {} ORDER BY seq",
                      station.empty() ? "" : "WHERE station = $1"),
          parameters));
  std::vector<StationEvent> events;
  events.reserve(rows.size());
  for (const Row& row : rows) {
    events.push_back({text_of(row[0]), from_ns(integer_of(row[1])), text_of(row[2]),
                      text_of(row[3]), text_of(row[4]), text_of(row[5]), text_of(row[6])});
  }
  return events;
}

Status Store::for_each_run(const RunFilter& filter,
                           const std::function<Status(const RunRecord&)>& visit) {
  std::vector<Value> parameters;
  std::string where = "seq > 0";
  const auto only = [&](std::string_view condition, Value value) {
    parameters.push_back(std::move(value));
    where += fmt::format(" AND {} ${}", condition, parameters.size());
  };
  if (!filter.kind.empty()) {
    only("kind =", filter.kind);
  }
  if (!filter.serial.empty()) {
    only("serial =", filter.serial);
  }
  if (!filter.station.empty()) {
    only("station =", filter.station);
  }
  if (filter.from) {
    only("started_ns >=", to_ns(*filter.from));
  }
  if (filter.to) {
    only("started_ns <", to_ns(*filter.to));
  }
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*impl_->database));
  SIXPOINT_ASSIGN(const auto rows,
                  impl_->database->stream(fmt::format("SELECT {} FROM runs WHERE {} "
                                                      "ORDER BY started_ns, seq",
                                                      kRunColumns, where),
                                          parameters));
  Row row;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, rows->next(row));
    if (!more) {
      return {};
    }
    SIXPOINT_CHECK(visit(to_run(row)));
  }
}

Result<std::optional<ConstantsRecord>> Store::constants_for(const std::string& serial,
                                                            const std::string& filter) {
  const std::vector<Value> parameters = {serial, filter};
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          fmt::format("SELECT {} FROM constants WHERE serial = $1 AND filter = $2 AND {} "
                      "ORDER BY made_at_ns DESC, seq DESC LIMIT 1",
                      kConstantsColumns, not_withdrawn()),
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
                      "FROM units"));
  std::vector<UnitRecord> records;
  records.reserve(rows.size());
  for (const Row& row : rows) {
    records.push_back({text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
                       static_cast<std::size_t>(integer_of(row[3]))});
  }
  // Here and not by the server, whose order depends on its locale.
  std::sort(records.begin(), records.end(),
            [](const UnitRecord& a, const UnitRecord& b) { return a.serial < b.serial; });
  return records;
}

Result<std::optional<RepairRecord>> Store::repair_of_output(const std::string& output_sha256) {
  const std::vector<Value> parameters = {output_sha256};
  // "+ 0": a planner without statistics would rather walk back along seq through millions of rows
  // than sort the one or two that the hash has.
  SIXPOINT_ASSIGN(const auto rows,
                  impl_->database->query(fmt::format("SELECT {} FROM repairs WHERE output_sha256 = "
                                                     "$1 ORDER BY seq + 0 DESC LIMIT 1",
                                                     kRepairColumns),
                                         parameters));
  if (rows.empty()) {
    return std::nullopt;
  }
  return to_repair(rows[0]);
}

Result<std::vector<RecallEntry>> Store::recall_list(const std::string& constants_id) {
  std::vector<Value> parameters;
  std::string only;
  if (!constants_id.empty()) {
    parameters.emplace_back(constants_id);
    only = " AND w.about_id = $1";
  }
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(fmt::format("SELECT {}, w.made_at_ns, w.reason FROM corrections w "
                                         "JOIN repairs ON repairs.constants_id = w.about_id "
                                         "WHERE {}{} ORDER BY repairs.seq, w.seq",
                                         kRepairColumns, kStillWithdrawn, only),
                             parameters));
  std::vector<RecallEntry> entries;
  for (const Row& row : rows) {
    RecallEntry entry{to_repair(row), from_ns(integer_of(row[kRepairColumnCount])),
                      text_of(row[kRepairColumnCount + 1])};
    // Constants may have been withdrawn twice, by two people: one line per file.
    if (entries.empty() || entries.back().repair.id != entry.repair.id) {
      entries.push_back(std::move(entry));
    }
  }
  return entries;
}

Result<std::vector<JigUnit>> Store::units_of_jig(const std::string& jig) {
  const std::vector<Value> parameters = {jig};
  SIXPOINT_ASSIGN(const auto rows, impl_->database->query(
                                       "SELECT serial, ended_ns, verdict FROM runs WHERE jig = $1 "
                                       "ORDER BY started_ns, seq",
                                       parameters));
  std::map<std::string, JigUnit> units;
  for (const Row& row : rows) {
    JigUnit& unit = units[text_of(row[0])];
    unit.serial = text_of(row[0]);
    ++unit.runs;
    unit.last_run = from_ns(integer_of(row[1]));
    unit.last_verdict = text_of(row[2]);
  }
  std::vector<JigUnit> list;
  list.reserve(units.size());
  for (auto& [serial, unit] : units) {
    list.push_back(std::move(unit));
  }
  return list;
}

// The verdicts after which the constants are used.
static bool is_passed(std::string_view verdict) {
  return verdict == "pass" || verdict == "conditional_pass";
}

double YieldReport::yield() const {
  return units == 0 ? std::numeric_limits<double>::quiet_NaN()
                    : static_cast<double>(passed) / static_cast<double>(units);
}

double YieldReport::first_pass_yield() const {
  return units == 0 ? std::numeric_limits<double>::quiet_NaN()
                    : static_cast<double>(passed_first_time) / static_cast<double>(units);
}

Result<YieldReport> Store::yield(UtcTime from, UtcTime to) {
  const std::vector<Value> parameters = {to_ns(from), to_ns(to)};
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query("SELECT serial, verdict, retest_of FROM runs WHERE kind = 'jig' "
                             "AND started_ns >= $1 AND started_ns < $2 ORDER BY started_ns, seq",
                             parameters));
  struct Runs {
    bool first_passed = false;
    bool last_passed = false;
  };
  std::map<std::string, Runs> units;
  std::size_t retests = 0;
  for (const Row& row : rows) {
    const bool passed = is_passed(text_of(row[1]));
    const auto [unit, is_new] = units.try_emplace(text_of(row[0]));
    if (is_new) {
      unit->second.first_passed = passed;
    }
    unit->second.last_passed = passed;
    retests += std::holds_alternative<std::monostate>(row[2]) ? 0 : 1;
  }
  YieldReport report;
  report.runs = rows.size();
  report.retests = retests;
  report.units = units.size();
  for (const auto& [serial, runs] : units) {
    report.passed += runs.last_passed ? 1 : 0;
    report.passed_first_time += runs.first_passed ? 1 : 0;
  }
  return report;
}

Result<std::vector<DueUnit>> Store::units_due(UtcTime older_than) {
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query("SELECT serial, model, (SELECT max(made_at_ns) FROM constants "
                             "WHERE constants.serial = units.serial AND " +
                             not_withdrawn() + ") FROM units"));
  std::vector<DueUnit> due;
  for (const Row& row : rows) {
    DueUnit unit{text_of(row[0]), text_of(row[1]), std::nullopt};
    if (!std::holds_alternative<std::monostate>(row[2])) {
      unit.last_constants = from_ns(integer_of(row[2]));
    }
    if (!unit.last_constants || *unit.last_constants < older_than) {
      due.push_back(std::move(unit));
    }
  }
  // The longest overdue first; nullopt sorts before every time.
  std::sort(due.begin(), due.end(), [](const DueUnit& a, const DueUnit& b) {
    return std::tie(a.last_constants, a.serial) < std::tie(b.last_constants, b.serial);
  });
  return due;
}

Result<std::vector<TrendPoint>> Store::trend(const std::string& serial) {
  const std::vector<Value> parameters = {serial};
  SIXPOINT_ASSIGN(
      const auto rows,
      impl_->database->query(
          fmt::format("SELECT {}, runs.jig, runs.station, runs.verdict, "
                      "CASE WHEN {} THEN 0 ELSE 1 END "
                      "FROM constants LEFT JOIN runs ON runs.id = constants.run_id "
                      "WHERE constants.serial = $1 ORDER BY constants.made_at_ns, constants.seq",
                      kConstantsColumns, not_withdrawn()),
          parameters));
  std::vector<TrendPoint> points;
  points.reserve(rows.size());
  for (const Row& row : rows) {
    constexpr std::size_t kNext = kConstantsColumnCount;
    points.push_back({to_constants(row), text_of(row[kNext]), text_of(row[kNext + 1]),
                      text_of(row[kNext + 2]), integer_of(row[kNext + 3]) > 0});
  }
  return points;
}

Result<AuditReport> Store::audit(const std::string& earlier_head) {
  AuditReport report;
  Bytes wanted;
  if (!earlier_head.empty()) {
    const auto bytes = from_hex(earlier_head);
    if (!bytes || bytes->size() != 32) {
      return fail(ErrorCode::usage, "the head is no hash", printable(earlier_head, 70),
                  "give the 64 digits that an earlier 'audit verify' printed");
    }
    wanted = *bytes;
  }
  bool met = earlier_head.empty() || wanted == Bytes(32, 0);
  const auto find = [&](std::string finding) {
    if (report.findings.size() < kMostFindings) {
      report.findings.push_back(std::move(finding));
    }
  };
  Database& database = *impl_->database;
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(database));

  // Attachments are named by their content.
  SIXPOINT_CHECK(
      for_each_attachment(database, [&](const std::string& name, const Bytes& bytes) -> Status {
        if (to_hex(sha256(bytes)) != name) {
          find(fmt::format("attachment {} was changed", printable(name, 70)));
        }
        return {};
      }));
  // The chain holds their names; the databases' own keys may have been switched off.
  SIXPOINT_ASSIGN(
      const auto lost,
      database.query(fmt::format("SELECT captures.sha256 FROM captures LEFT JOIN attachments "
                                 "ON attachments.sha256 = captures.sha256 "
                                 "WHERE attachments.sha256 IS NULL ORDER BY captures.seq LIMIT {}",
                                 kMostFindings)));
  for (const Row& capture : lost) {
    find(fmt::format("attachment {} was removed", printable(text_of(capture[0]), 70)));
  }

  SIXPOINT_ASSIGN(auto history, HistoryReader::open(database));
  ChainHasher hasher;
  Bytes previous(32, 0);
  std::int64_t expected = 1;
  HistoryRow row;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, history.next(row));
    if (!more) {
      break;
    }
    if (row.seq != expected) {
      find(row.seq > expected ? fmt::format("rows {} to {} are missing", expected, row.seq - 1)
                              : fmt::format("row {} is there twice", row.seq));
    }
    const Sha256Digest hash = hasher.hash(previous, *row.table, row.seq, row.columns);
    if (!std::equal(hash.begin(), hash.end(), row.hash.begin(), row.hash.end())) {
      find(fmt::format("{} does not fit the chain: it, or one before it, was changed",
                       name_of(row)));
    }
    // Go on from what is written, so that one changed row is one finding and not all that follow.
    previous.assign(row.hash.begin(), row.hash.end());
    met = met || previous == wanted;
    expected = row.seq + 1;
    ++report.rows;
  }
  const auto head = read_head(database);
  if (!head || head->rows != expected - 1 || head->hash != previous) {
    find("the head does not name the last row: rows at the end were removed or added");
  }
  if (!met) {
    find(
        fmt::format("the head {} that was written down is no row of this chain: the history was "
                    "written anew, or this is another store",
                    printable(earlier_head, 70)));
  }
  report.head = to_hex(previous);
  report.ok = report.findings.empty();
  return report;
}

}  // namespace sixpoint::db
