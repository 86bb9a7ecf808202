#include "base/text/csv_columns.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint {

namespace {

struct Line {
  std::vector<std::string> fields;
  std::size_t line_ends = 0;  // within quotes
  bool is_closed = true;      // the last quote
};

// Takes the next line, with its end, from the front of `csv`. A quote that does not begin a field is
// a character as any other.
Line take_line(std::string_view& csv) {
  Line line;
  line.fields.emplace_back();
  bool is_begin = true;    // of a field
  std::size_t quoted = 0;  // characters of the field that were in quotes: their blanks stay
  std::size_t at = 0;
  for (bool is_end = false; at < csv.size() && !is_end; ++at) {
    const char c = csv[at];
    std::string& field = line.fields.back();
    if (!line.is_closed && c == '"' && csv.substr(at + 1).starts_with('"')) {
      field += c;
      ++at;
    } else if (!line.is_closed && c != '"') {
      field += c;
      line.line_ends += c == '\n' ? 1 : 0;
    } else if (!line.is_closed) {
      line.is_closed = true;
      quoted = field.size();
    } else if (c == '"' && is_begin) {
      line.is_closed = false;
    } else if (c == ',') {
      line.fields.emplace_back();
      quoted = 0;
    } else if (c == '\n') {
      is_end = true;
    } else {
      field += c;
    }
    is_begin = c == ',' && line.is_closed;
  }
  csv.remove_prefix(at);
  std::string& last = line.fields.back();
  last.erase(std::max(quoted, last.find_last_not_of("\r ") + 1));
  return line;
}

}  // namespace

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
  for (std::size_t line_ends = 0; !csv.empty();) {
    line_number += 1 + line_ends;
    const Line line = take_line(csv);
    line_ends = line.line_ends;
    const std::vector<std::string>& fields = line.fields;
    if (!line.is_closed) {
      return wrong("a quote is not closed");
    }
    if (fields.size() == 1 && fields[0].empty()) {
      continue;
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
