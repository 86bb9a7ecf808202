#include "db/records.h"

#include <algorithm>
#include <concepts>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "base/text/json_text.h"
#include "base/text/utf8.h"
#include "db/chain.h"
#include "db/name_rule.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLongestName = 200;
constexpr std::size_t kLongestReason = 20'000;
constexpr std::size_t kLongestCode = 2000;
constexpr std::size_t kLargestDocument = 64U << 20;
// PostgreSQL takes 1 GiB, and an export writes twice as many hex digits on one line.
constexpr std::size_t kLargestCapture = 100U << 20;

// What both servers store unchanged.
bool is_storable(std::string_view text) { return text.find('\0') == text.npos && is_utf8(text); }

Status check_text(std::string_view text, std::size_t limit) {
  if (text.size() > limit || !is_storable(text)) {
    return fail(ErrorCode::bad_data,
                fmt::format("'{}' cannot be stored as a text", printable(text, 40)), {},
                fmt::format("the store takes up to {} bytes of UTF-8 there", limit));
  }
  return {};
}

}  // namespace

Status check_name(std::string_view name) { return check_text(name, kLongestName); }

namespace {

Status check_content(Content content, const std::string& text) {
  switch (content) {
    case Content::name:
      return check_name(text);
    case Content::reason:
      return check_text(text, kLongestReason);
    case Content::text:
      return check_text(text, kLargestDocument);
    case Content::serial:
      if (text.empty() || text.size() > kLongestName || printable(text) != text ||
          !is_storable(text)) {
        return fail(ErrorCode::bad_data,
                    fmt::format("'{}' is no serial number", printable(text, 40)), {},
                    fmt::format("a serial number has 1 to {} printable characters", kLongestName));
      }
      return {};
    case Content::filter:
      if (text != "legacy" && text != "current") {
        return fail(ErrorCode::bad_data,
                    fmt::format("'{}' is no filter configuration", printable(text, 40)), {},
                    "it is 'legacy' or 'current'");
      }
      return {};
    case Content::json:
      if (text.size() > kLargestDocument || !Json::accept(text)) {
        return fail(ErrorCode::bad_data, "the document is no JSON", {}, "please report this");
      }
      return {};
  }
  return {};
}

Status check_column(const Column& column, const Value& value) {
  if (std::holds_alternative<std::monostate>(value) ? column.required
      : column.type == ColumnType::integer          ? !std::holds_alternative<std::int64_t>(value)
                                                    : !std::holds_alternative<std::string>(value)) {
    return fail(ErrorCode::bad_data, fmt::format("the column {} has no such value", column.name),
                {}, "please report this");
  }
  const auto* text = std::get_if<std::string>(&value);
  return text == nullptr ? Status() : check_content(column.content, *text);
}

// The columns of a record in the order of its table, without the key. The only place where records
// and schema.h meet; const or not as the record is.
template <class Record>
auto fields_of(Record& r) {
  using Kind = std::remove_const_t<Record>;
  if constexpr (std::same_as<Kind, ConstantsRecord>) {
    return std::tie(r.serial, r.filter, r.made_at, r.method, r.run_id, r.document,
                    r.standard_uncertainty, r.origin);
  } else if constexpr (std::same_as<Kind, RunRecord>) {
    return std::tie(r.serial, r.kind, r.filter, r.started, r.ended, r.operator_name, r.station,
                    r.jig, r.verdict, r.software, r.retest_of, r.document, r.jig_due, r.build,
                    r.limits, r.gravity_m_per_s2, r.temperature_c, r.codes);
  } else if constexpr (std::same_as<Kind, UnitWrite>) {
    return std::tie(r.run_id, r.serial, r.written, r.as_found, r.as_left, r.read_back);
  } else if constexpr (std::same_as<Kind, RepairRecord>) {
    return std::tie(r.serial, r.made_at, r.input, r.input_sha256, r.output_sha256, r.method,
                    r.constants_id, r.document, r.software);
  } else if constexpr (std::same_as<Kind, Correction>) {
    return std::tie(r.made_at, r.table, r.row_id, r.action, r.operator_name, r.reason);
  } else {
    return std::tie(r.made_at, r.station, r.serial, r.action, r.operator_name, r.reason);
  }
}

Value to_value(const std::string& text) { return text; }
Value to_value(UtcTime time) { return to_ns(time); }
Value to_value(const std::optional<UtcTime>& time) { return time ? Value(to_ns(*time)) : Value(); }
Value to_value(const std::optional<double>& number) {
  return number ? Value(Json(*number).dump()) : Value();
}
Value to_value(const std::vector<std::string>& texts) {
  return texts.empty() ? Value() : Value(Json(texts).dump());
}

void from_value(const Value& value, std::string& text) { text = text_of(value); }
void from_value(const Value& value, UtcTime& time) { time = from_ns(integer_of(value)); }
void from_value(const Value& value, std::optional<UtcTime>& time) {
  time = std::holds_alternative<std::monostate>(value) ? std::nullopt
                                                       : std::optional(from_ns(integer_of(value)));
}
void from_value(const Value& value, std::optional<double>& number) {
  const Json json = parse_json(text_of(value));
  number = json.is_number() ? std::optional(json.get<double>()) : std::nullopt;
}
void from_value(const Value& value, std::vector<std::string>& texts) {
  const Json json = parse_json(text_of(value));
  for (const Json& one : json.is_array() ? json : Json::array()) {
    texts.push_back(one.is_string() ? one.get<std::string>() : one.dump());
  }
}

template <class Record>
Result<Row> row_of(const Record& record) {
  const Table& into = table(Record::kTable);
  Row columns;
  std::apply([&](const auto&... field) { (columns.push_back(to_value(field)), ...); },
             fields_of(record));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (!into.columns[i + 1].required && columns[i] == Value(std::string())) {
      columns[i] = Value();
    }
  }
  return new_row(into, std::move(columns));
}

// A member of a JSON document as text, or NULL.
Value member_of(const Json& document, const char* key) {
  if (!document.is_object() || !document.contains(key) || document[key].is_null()) {
    return {};
  }
  return document[key].dump();
}

NewRows rows_with(Row row, const Table& into) {
  NewRows rows{text_of(row[0])};
  rows.rows.emplace_back(&into, std::move(row));
  return rows;
}

// What a record of a unit says about the unit and the filter, before the record's own row.
Status add_unit(NewRows& rows, const std::string& serial, const std::string& model, UtcTime seen,
                const std::string& filter) {
  SIXPOINT_ASSIGN(Row unit, new_row(table("units"), {serial, model, to_ns(seen)}));
  SIXPOINT_ASSIGN(
      Row configuration,
      new_row(table("filter_configurations"),
              {filter, std::string(filter == "legacy"
                                       ? "the sensor's filter as firmware before 2014-03-24 set it"
                                       : "the sensor's filter as firmware sets it since "
                                         "2014-03-24")}));
  rows.rows.emplace(rows.rows.begin(), &table("filter_configurations"), std::move(configuration));
  rows.rows.emplace(rows.rows.begin(), &table("units"), std::move(unit));
  return {};
}

}  // namespace

template <class Record>
Record record_of(const Row& row) {
  Record record;
  if constexpr (requires { record.id; }) {
    record.id = text_of(row[0]);
  }
  std::size_t i = 1;
  std::apply([&](auto&... field) { (from_value(row[i++], field), ...); }, fields_of(record));
  return record;
}
template ConstantsRecord record_of(const Row&);
template RunRecord record_of(const Row&);
template UnitWrite record_of(const Row&);
template RepairRecord record_of(const Row&);
template Correction record_of(const Row&);
template StationEvent record_of(const Row&);

Result<Row> new_row(const Table& table, Row columns) {
  const bool has_id = table.columns[0].name == "id";
  const std::size_t first = has_id ? 1 : 0;
  if (columns.size() + first != table.columns.size()) {
    return fail(ErrorCode::internal, "a row of another table", std::string(table.name),
                "please report this");
  }
  if (table.name == "constants") {
    // Copied from the document for people's statements, so no part of the id.
    const Json document = parse_json(text_of(columns[5]));
    columns[6] = member_of(document, "standard_uncertainty");
    columns[7] = member_of(document, "made_from");
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    SIXPOINT_CHECK(check_column(table.columns[i + first], columns[i]));
  }
  if (has_id) {
    const std::size_t named = table.name == "constants" ? 6 : columns.size();
    std::string id = ChainHasher().identifier(table, std::span(columns).first(named));
    columns.insert(columns.begin(), Value(std::move(id)));
  }
  return columns;
}

Result<Row> new_row(const Correction& correction) { return row_of(correction); }
Result<Row> new_row(const StationEvent& event) { return row_of(event); }

Result<NewRows> rows_of(const ConstantsRecord& record, const std::string& model) {
  SIXPOINT_ASSIGN(Row row, row_of(record));
  NewRows rows = rows_with(std::move(row), table("constants"));
  SIXPOINT_CHECK(add_unit(rows, record.serial, model, record.made_at, record.filter));
  return rows;
}

Result<NewRows> rows_of(const RunRecord& run, const std::vector<Capture>& captures) {
  for (const std::string& code : run.codes) {
    SIXPOINT_CHECK(check_text(code, kLongestCode));
  }
  SIXPOINT_ASSIGN(Row row, row_of(run));
  NewRows rows = rows_with(std::move(row), table("runs"));
  SIXPOINT_CHECK(add_unit(rows, run.serial, run.model, run.started, run.filter));
  for (const Capture& capture : captures) {
    if (capture.bytes.size() > kLargestCapture) {
      return fail(ErrorCode::bad_data,
                  fmt::format("the capture {} has {} bytes", printable(capture.name, 60),
                              capture.bytes.size()),
                  {}, fmt::format("the store takes up to {} bytes", kLargestCapture));
    }
    std::string hash = to_hex(sha256(capture.bytes));
    SIXPOINT_ASSIGN(Row its, new_row(table("captures"), {rows.id, capture.name, hash}));
    rows.rows.emplace_back(&table("captures"), std::move(its));
    rows.attachments.emplace_back(std::move(hash), capture.bytes);
  }
  return rows;
}

Result<NewRows> rows_of(const UnitWrite& write) {
  SIXPOINT_ASSIGN(Row row, row_of(write));
  return rows_with(std::move(row), table("unit_writes"));
}

Result<NewRows> rows_of(const RepairRecord& repair) {
  RepairRecord storable = repair;
  storable.input = storable_path(repair.input);
  SIXPOINT_ASSIGN(Row row, row_of(storable));
  return rows_with(std::move(row), table("repairs"));
}

// The name of a file may be any bytes; it is evidence, so it is written in a form that can be
// stored rather than refused.
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

Result<std::string> RecordWriter::add_constants(const ConstantsRecord& record,
                                                const std::string& model) {
  SIXPOINT_ASSIGN(NewRows rows, rows_of(record, model));
  return add(std::move(rows));
}

Result<std::string> RecordWriter::add_run(const RunRecord& run,
                                          const std::vector<Capture>& captures) {
  SIXPOINT_ASSIGN(NewRows rows, rows_of(run, captures));
  return add(std::move(rows));
}

Result<std::string> RecordWriter::add_unit_write(const UnitWrite& write) {
  SIXPOINT_ASSIGN(NewRows rows, rows_of(write));
  return add(std::move(rows));
}

Result<std::string> RecordWriter::add_repair(const RepairRecord& repair) {
  SIXPOINT_ASSIGN(NewRows rows, rows_of(repair));
  return add(std::move(rows));
}

}  // namespace sixpoint::db
