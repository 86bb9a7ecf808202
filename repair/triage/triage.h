// Which files are affected by 16CPAN03, and which cannot be told.
//
//   const Triage answer = triage({"MOS2A45130450", "1.5.0", parse_iso8601("2013-11-12").value()});
//   answer.verdict;   // Verdict::affected
//
// A file is affected when all three hold (paper, "16CPAN03 Issue Description"): its unit's serial
// number begins with MOS; the unit was calibrated before 2014-03-24, so that its constants belong
// to the `legacy` filter configuration; it was recorded by firmware 1.4.0, 1.4.1, 1.5.0, 1.6.0
// or 1.7.0, which set `current` regardless.
//
// | serial number | calibrated         | firmware                        | verdict      |
// |---------------|--------------------|---------------------------------|--------------|
// | not said, two | any                | any                             | cannot_tell  |
// | not MOS...    | any                | any                             | not_affected |
// | MOS...        | from 2014-03-24 on | any                             | not_affected |
// | MOS...        | any                | below 1.4.0, or from 1.8.0 on   | not_affected |
// | MOS...        | before             | one of the five                 | affected     |
// | MOS...        | before or not said | not said, or 1.4.0 to 1.7.x but | cannot_tell  |
// |               |                    | not one of the five             |              |
// | MOS...        | not said           | one of the five                 | cannot_tell  |
// | MOS...        | any                | two, which lead to two answers  | cannot_tell  |
// | MOS...        | two, which lead    | any                             | cannot_tell  |
// |               | to two answers     |                                 |              |
//
// A date before 2012 is none: the family was not made then, so a clock had not been set. Nor is one
// more than a day behind the start of the recording, where that is from 2012 on: a unit is
// calibrated before it records, so one of the two clocks was wrong; the day is for zones of time.
// Two firmware versions: info.txt names two, or one and the PARAMETERS record another. Two dates: of
// two PARAMETERS records.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "calib/constants.h"

namespace sixpoint::repair {

// What a file says about itself; empty or nothing where it does not say.
struct FileFacts {
  std::string serial;
  std::string firmware;
  std::optional<UtcTime> calibration_time;
  std::string other_firmware = {};       // of another line or the PARAMETERS record, if it differs
  std::optional<UtcTime> recorded = {};  // from then on, as the header says
  std::optional<UtcTime> other_calibration_time = {};  // where a later record names another
  std::string other_serial = {};                       // where info.txt names two units
};

// The date, where it can be one.
std::optional<UtcTime> date_of_constants(const FileFacts& facts);

enum class Verdict { affected, not_affected, cannot_tell };
std::string_view to_string(Verdict verdict);

struct Triage {
  Verdict verdict = Verdict::cannot_tell;
  std::vector<std::string> reasons;  // one sentence each, the deciding ones first
  // Firmware 1.6.0 on a MOS unit: stored x' = -y, y' = x, whatever the verdict on the constants.
  bool axes_rotated = false;
};
Triage triage(const FileFacts& facts);

// Which configuration the firmware had set when the file was recorded, and under which one the
// stored constants were measured (domain: "What was measured under which configuration"). Nothing
// where the facts do not suffice, or where the unit is no MOS unit and the question has no meaning.
std::optional<calib::FilterConfiguration> filter_in_force(const FileFacts& facts);
std::optional<calib::FilterConfiguration> filter_of_constants(const FileFacts& facts);

// Firmware 1.1.0's release, before which every unit was calibrated under `legacy`.
UtcTime filter_change();  // 2014-03-24T00:00:00Z
// The first affected units were shipped on 2013-11-07 (paper, "16CPAN03 Issue Description"); nearly
// two years more are allowed for, so that only clocks that were never set lie before it.
UtcTime first_possible_calibration();  // 2012-01-01T00:00:00Z

// "1.10.2" compared number by number; nothing where the text is no version.
struct FirmwareVersion {
  int major_number = 0;
  int minor_number = 0;
  int patch = 0;
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the zero inside <=> for a pointer
  auto operator<=>(const FirmwareVersion&) const = default;
};
std::optional<FirmwareVersion> parse_firmware(std::string_view text);

}  // namespace sixpoint::repair
