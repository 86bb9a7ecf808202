#include "db/export_json.h"

#include <fmt/format.h>

#include "base/sha256.h"
#include "base/text/json_text.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "sixpoint/store-export/1";

std::optional<Bytes> bytes_of(const Json& json, const char* key) {
  return json.contains(key) && json[key].is_string()
             ? from_hex(json[key].get_ref<const std::string&>())
             : std::nullopt;
}

Result<Value> value_of(const Json& json, const Column& column) {
  if (json.is_null() && !column.required) {
    return Value();
  }
  if (column.type == ColumnType::integer && json.is_number_integer() &&
      !(json.is_number_unsigned() && json.get<std::uint64_t>() > INT64_MAX)) {
    return Value(json.get<std::int64_t>());
  }
  if (column.type == ColumnType::text && json.is_string()) {
    return Value(json.get<std::string>());
  }
  if (column.type == ColumnType::text && json.is_object()) {
    if (const auto bytes = bytes_of(json, "bytes")) {
      return Value(std::string(as_text(*bytes)));
    }
  }
  return fail(ErrorCode::bad_data, fmt::format("the column {} has no such value", column.name), {},
              "export again");
}

}  // namespace

Json to_json(const ExportHeader& header) {
  return {{"schema", kFormat},
          {"store_version", header.store_version},
          {"rows", header.rows},
          {"head", header.head}};
}

Result<ExportHeader> header_from_json(const Json& json) {
  if (!json.contains("schema") || json["schema"] != kFormat || !json.contains("store_version") ||
      !json["store_version"].is_number_integer() || !json.contains("rows") ||
      !json["rows"].is_number_integer() || !json.contains("head") || !json["head"].is_string()) {
    return fail(ErrorCode::bad_data, "the first line is not that of a store's export", {},
                "make the file with 'sixpoint store export'");
  }
  ExportHeader header{json["store_version"].get<std::int64_t>(), json["rows"].get<std::int64_t>(),
                      json["head"].get<std::string>()};
  if (header.store_version > kSchemaVersion) {
    return fail(ErrorCode::configuration,
                fmt::format("the file is of a store of version {}, this program knows versions up "
                            "to {}",
                            header.store_version, kSchemaVersion),
                {}, "use the sixpoint that made it, or a newer one");
  }
  return header;
}

Json row_to_json(const Table& table, std::span<const Value> columns, TextForm form) {
  Json json = Json::object();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    Json& value = json[std::string(table.columns[i].name)];
    if (const auto* integer = std::get_if<std::int64_t>(&columns[i])) {
      value = *integer;
    } else if (const auto* text = std::get_if<std::string>(&columns[i])) {
      value = form == TextForm::text ? Json(*text) : Json{{"bytes", to_hex(as_bytes(*text))}};
    }
  }
  return json;
}

Result<Row> row_from_json(const Table& table, const Json& json) {
  if (!json.is_object()) {
    return fail(ErrorCode::bad_data, "the row is no object", {}, "export again");
  }
  Row row;
  std::size_t known = 0;
  for (const Column& column : table.columns) {
    const std::string name(column.name);
    known += json.contains(name) ? 1 : 0;
    SIXPOINT_ASSIGN(row.emplace_back(),
                    value_of(json.contains(name) ? json[name] : Json(nullptr), column));
  }
  if (known != json.size()) {
    return fail(ErrorCode::bad_data, "it has columns that this program does not know", {},
                "export again");
  }
  return row;
}

Json attachment_to_json(const std::string& sha256, const Bytes& bytes) {
  return {{"attachment", sha256}, {"bytes", to_hex(bytes)}};
}

Result<std::pair<std::string, Bytes>> attachment_from_json(const Json& json) {
  const std::string name =
      json.contains("attachment") && json["attachment"].is_string() ? json["attachment"] : "?";
  auto bytes = bytes_of(json, "bytes");
  if (!bytes || to_hex(sha256(*bytes)) != name) {
    return fail(ErrorCode::bad_data,
                fmt::format("the attachment {} is not what its name says", printable(name, 64)), {},
                "export again");
  }
  return std::pair(name, *std::move(bytes));
}

Result<Json> parse_json_line(std::string_view text) {
  auto json = parse_json<Json>(text);
  if (!json.is_object()) {
    return fail(ErrorCode::bad_data, "the line is no JSON object of an export", {}, "export again");
  }
  return json;
}

}  // namespace sixpoint::db
