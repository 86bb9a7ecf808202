// Calendar time in UTC and its two spellings: ISO 8601 for people and JSON, Unix seconds for
// records.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace sixpoint {

using UtcTime = std::chrono::sys_time<std::chrono::nanoseconds>;

UtcTime from_unix_seconds(std::int64_t seconds);
std::int64_t to_unix_seconds(UtcTime time);  // rounds down

// "2014-03-24T00:00:00Z"; with a fraction ("...00.125Z") only where there is one.
std::string to_iso8601(UtcTime time);

// Accepts "2013-11-12", "2013-11-12T10:00:00", "2013-11-12T10:00:00.125", each with or without "Z".
// bad_data otherwise.
Result<UtcTime> parse_iso8601(std::string_view text);

}  // namespace sixpoint
