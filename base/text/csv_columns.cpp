#include "base/text/csv_columns.h"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint {

Result<std::vector<CsvRow>> csv_columns(std::string_view csv,
                                        std::span<const std::string_view> names,
                                        const std::string& where) {
  std::vector<CsvRow> rows;
  std::vector<std::size_t> columns;
  std::size_t line_number = 0;
  const auto wrong = [&](std::string what) {
    return fail(ErrorCode::bad_data, std::move(what), fmt::format("{}:{}", where, line_number),
                fmt::format("the first line is '{}', and every line below has all of them",
                            fmt::join(names, ",")));
  };
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // spreadsheets begin with it
  if (csv.starts_with(kByteOrderMark)) {
    csv.remove_prefix(kByteOrderMark.size());
  }
  std::istringstream lines{std::string(csv)};
  for (std::string line; std::getline(lines, line);) {
    ++line_number;
    line.erase(line.find_last_not_of("\r ") + 1);
    std::erase(line, '"');
    if (line.empty()) {
      continue;
    }
    std::vector<std::string> fields;
    std::istringstream cells(line + ",");
    for (std::string cell; std::getline(cells, cell, ',');) {
      fields.push_back(std::move(cell));
    }
    if (line_number == 1) {
      for (const std::string_view name : names) {
        const auto found = std::find(fields.begin(), fields.end(), name);
        if (found == fields.end()) {
          return wrong(fmt::format("no column '{}'", name));
        }
        columns.push_back(static_cast<std::size_t>(found - fields.begin()));
      }
      continue;
    }
    if (columns.empty()) {
      return wrong("the first line is empty");
    }
    CsvRow row{line_number, {}};
    for (const std::size_t column : columns) {
      if (column >= fields.size()) {
        return wrong("a line is too short");
      }
      row.fields.push_back(fields[column]);
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) {
    return wrong("no rows");
  }
  return rows;
}

}  // namespace sixpoint
