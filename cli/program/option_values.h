// What no option of any command takes as its value.
//
//   why_no_value("UINT", "-1");  // "-1 is below 0"
//
//     the option takes   value              answer
//     anything           "" (empty)         refused: it would count as "not given"
//     a number           nan, inf, 1e999    refused: no range check refuses nan
//     a whole number     2^64 and above     refused: it would become the largest number
//     a count or a seed  -1                 refused: it would wrap round to 2^64-1
//     a value or none    "" (empty)         allowed
//
// Positional arguments are such options too.
#pragma once

#include <string>
#include <string_view>

#include <CLI/App.hpp>

namespace sixpoint::cli {

// Why an option of this type takes no such value; empty where it may. `type` is CLI11's name for
// it: TEXT, INT, UINT, FLOAT.
std::string why_no_value(std::string_view type, const std::string& value);

// Checks every option of the app and of its commands so, before the option's own checks. Once, when
// all are declared.
void refuse_unusable_values(CLI::App& app);

}  // namespace sixpoint::cli
