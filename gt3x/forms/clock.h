// Which clock the times in a recording are by: the wearer's, or UTC.
//
//   ClockEvidence evidence;
//   evidence.take_info(info);                 // info.txt
//   evidence.take_metadata(record.payload);   // each METADATA record
//   const Clock clock = which_clock(evidence);
//   clock_time(clock, 1'428'588'240);         // "2015-04-09T14:04:00-04:00"
//
// ActiLife sets a unit's clock to local time; CentrePoint and Study Admin set it to UTC and say the
// offset apart. Both write it as Unix time. The first row that fits holds (the vendor's public
// description of METADATA, and what readers of its files found):
//
// | evidence                                              | clock   | offset of local time      |
// |-------------------------------------------------------|---------|---------------------------|
// | METADATA LocalTimeLog, "UsedUtc": true                | utc     | SubjectTimeLog, or what   |
// |                                                       |         | else names one            |
// | METADATA LocalTimeLog, "UsedUtc": false               | local   | LocalTimeLog, or TimeZone |
// | CentrePoint or Study Admin named (METADATA InitOwner, | utc     | SubjectTimeLog, or what   |
// | or a line of info.txt with the software)              |         | else names one            |
// | ActiLife named (likewise), or METADATA LocalTimeLog   | local   | LocalTimeLog, or TimeZone |
// | raw counts (ACTIVITY3), as CentrePoint's .agdc hold   | utc     | SubjectTimeLog, or what   |
// |                                                       |         | else names one            |
// | old form: the clock of the computer that set it       | local   | TimeZone                  |
// | UTC_OFFSET in PARAMETERS that is not 0                | utc     | SubjectTimeLog, or what   |
// |                                                       |         | else names one            |
// | nothing of these                                      | unknown | -                         |
//
// "What else names one": LocalTimeLog, the TimeZone line of info.txt, UTC_OFFSET, in this order.
// The offset is that of the day on which the unit was set; a change to or from summer time later
// is not in the file.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/time.h"
#include "gt3x/forms/info.h"

namespace sixpoint::gt3x {

enum class ClockKind { local, utc, unknown };
std::string_view to_string(ClockKind kind);

struct Clock {
  ClockKind kind = ClockKind::unknown;
  std::optional<int> offset_minutes;  // local time minus UTC
  std::string why;                    // one sentence
};

struct ClockEvidence {
  bool local_time_log = false;
  std::optional<bool> used_utc;               // LocalTimeLog
  std::optional<int> log_offset_minutes;      // LocalTimeLog
  std::optional<int> subject_offset_minutes;  // SubjectTimeLog
  std::optional<int> header_offset_minutes;   // info.txt, TimeZone
  std::optional<int> unit_offset_minutes;     // PARAMETERS, UTC_OFFSET, where it is not 0
  std::string software;
  bool raw_counts = false;
  bool old_form = false;

  void take_info(const Info& info);
  // What is no JSON of the vendor's form says nothing.
  void take_metadata(std::span<const std::uint8_t> payload);
};

Clock which_clock(const ClockEvidence& evidence);

// ISO 8601 in local time with its offset where that is known, as UTC with a Z where that is all
// that is known, else as the file has it, without a zone.
std::string clock_time(const Clock& clock, std::int64_t unix_s);
std::string clock_time(const Clock& clock, UtcTime time);  // the same, with a fraction

// "-05:00:00" -> -300; nothing for what is no offset (beyond 14 hours, or no such form).
std::optional<int> parse_offset(std::string_view text);

}  // namespace sixpoint::gt3x
