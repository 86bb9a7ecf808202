// Columns of a small CSV file, by the names in its first line.
//
//   constexpr std::array<std::string_view, 2> kNames = {"serial", "lot"};
//   SIXPOINT_ASSIGN(const auto rows, csv_columns("lot,serial\nA,MOS1\n", kNames, "lots.csv"));
//   rows[0].fields;  // "MOS1", "A"
//
// For what people keep in a spreadsheet: any order of the columns, further columns, empty lines,
// line ends of any system, a byte-order mark. A field in quotes may hold commas, line ends and
// quotes (written twice), as RFC 4180 has it and csv_field() writes it. Pure function; any thread.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace sixpoint {

struct CsvRow {
  std::size_t line = 0;             // where it begins in the file, from 1
  std::vector<std::string> fields;  // in the order of the names that were asked for
};

// bad_data where a name is not in the first line, a line is too short, a quote is not closed, or
// there is no row; `where` names the file.
Result<std::vector<CsvRow>> csv_columns(std::string_view csv,
                                        std::span<const std::string_view> names,
                                        const std::string& where);

}  // namespace sixpoint
