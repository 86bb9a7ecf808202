// The JSON of an export (docs/store.md): its first line, a row, an attachment. The journal writes
// rows and attachments in the same form.
//
//   const auto json = row_to_json(table("units"), row);  // {"serial": "MOS2A1", "model": "w", ...}
//   SIXPOINT_ASSIGN(const Row same, row_from_json(table("units"), json));
#pragma once

#include <span>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "base/result.h"
#include "db/schema.h"

namespace sixpoint::db {

// The first line.
struct ExportHeader {
  std::int64_t store_version = 0;
  std::int64_t rows = 0;
  std::string head;  // hex SHA-256 of the last row
};
nlohmann::ordered_json to_json(const ExportHeader& header);
// bad_data for another line, configuration for a store of a newer version.
Result<ExportHeader> header_from_json(const nlohmann::ordered_json& json);

enum class TextForm {
  text,
  hex  // {"bytes": hexadecimal}: for rows of early versions, whose file names may be no UTF-8
};
nlohmann::ordered_json row_to_json(const Table& table, std::span<const Value> columns,
                                   TextForm form = TextForm::text);

// In either form. bad_data for a column that is unknown, missing or of another type.
Result<Row> row_from_json(const Table& table, const nlohmann::ordered_json& json);

nlohmann::ordered_json attachment_to_json(const std::string& sha256, const Bytes& bytes);
// bad_data where the bytes do not have the hash that is their name.
Result<std::pair<std::string, Bytes>> attachment_from_json(const nlohmann::ordered_json& json);

// One line, without trusting it: an object, at most four levels deep.
Result<nlohmann::ordered_json> parse_json_line(std::string_view text);

}  // namespace sixpoint::db
