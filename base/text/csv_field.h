// A field of a CSV file.
//
//   csv_field("bench 1, left");  // "\"bench 1, left\""
#pragma once

#include <string>
#include <string_view>

namespace sixpoint {

// As RFC 4180 has it: in quotes where it holds a comma, a quote or a line end. Pure function; any
// thread.
std::string csv_field(std::string_view text);

}  // namespace sixpoint
