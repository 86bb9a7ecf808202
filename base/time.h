// Calendar time in UTC and its two spellings: ISO 8601 for people and JSON, Unix seconds for
// records.
//
//   SIXPOINT_ASSIGN(const UtcTime time, parse_iso8601("2014-03-24"));
//   to_iso8601(time + from_seconds(0.125));  // "2014-03-24T00:00:00.125Z"
//   to_unix_seconds(time);                   // 1395619200
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace sixpoint {

using UtcTime = std::chrono::sys_time<std::chrono::nanoseconds>;

// A span of time given in seconds, rounded towards zero to whole nanoseconds.
inline std::chrono::nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(time_s));
}

UtcTime from_unix_seconds(std::int64_t seconds);
std::int64_t to_unix_seconds(UtcTime time);  // rounds down

// "2014-03-24T00:00:00Z"; with a fraction ("...00.125Z") only where there is one.
std::string to_iso8601(UtcTime time);

// Accepts "2013-11-12", "2013-11-12T10:00:00", "2013-11-12T10:00:00.125", each with or without "Z".
// bad_data otherwise.
Result<UtcTime> parse_iso8601(std::string_view text);

}  // namespace sixpoint
