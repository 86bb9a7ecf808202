// Which of a unit's constants apply, and why.
//
//   SIXPOINT_ASSIGN(const db::UnitHistory history, store.constants_history("MOS2A1"));
//   const Applying applying =
//       applying_constants(history, calib::FilterConfiguration::current);
//   if (applying.index) {
//     const std::string id = history.constants[*applying.index].id;
//   }
//
// Only sets of the filter configuration that is asked for, and not withdrawn, can apply. Of these:
//
// | sets                                                   | applies                            |
// |--------------------------------------------------------|------------------------------------|
// | none                                                   | nothing                            |
// | one that a person prefers (the last word counts)       | that one                           |
// | of several methods                                     | jig before calibration file before |
// |                                                        | file scan                          |
// | ... but a newer set of a method behind disagrees       | nothing: a person must decide      |
// | of one method, one with a smaller stated uncertainty   | that one (10 % count as equal, no  |
// |                                                        | uncertainty comes last)            |
// | of one method, equally certain                         | the latest `made_at`, of equals    |
// |                                                        | the last one stored                |
// | ... but another one of that method disagrees           | the same; `doubt` says it          |
//
// Two sets disagree as calib/application/agreement.h has it. Sets of an earlier version, which do
// not say where they were made, count as file scans unless their method is the jig's.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/constants.h"
#include "db/questions.h"

namespace sixpoint::repair {

// In order of trust.
enum class ConstantsKind { jig, calibration_file, file_scan };
ConstantsKind kind_of(const db::ConstantsRecord& record);

struct Applying {
  std::optional<std::size_t> index;  // into UnitHistory::constants
  std::string why;                   // it applies, or why nothing does
  bool conflict = false;             // a person must decide ('sixpoint store prefer')
  // Another set of the same method disagrees with the one that applies, which no person preferred.
  std::string doubt;
  // Where nothing applies: the sets of this configuration that were withdrawn, when and why.
  std::string withdrawn;
  // Of every set of the history: why it applies or does not.
  std::vector<std::string> about;
};
Applying applying_constants(const db::UnitHistory& history, calib::FilterConfiguration filter);

// What a person must read when the set `id` of this history was stored just now; empty for nothing:
//
// | by applying_constants()                | said                                                 |
// |----------------------------------------|------------------------------------------------------|
// | it applies, and no other one disagrees | nothing                                              |
// | it applies, but another one disagrees  | `doubt`                                              |
// | another one applies                    | which one, of which date, why, and how that is ended |
// | ... of a date behind `now`             | that a clock was ahead, too                          |
// | nothing applies                        | `why`                                                |
std::string said_of_stored(const db::UnitHistory& history, calib::FilterConfiguration filter,
                           const std::string& id, UtcTime now);

}  // namespace sixpoint::repair
