// What counts of a replayed session (docs/sessions.md): nothing, for it gives the answers of
// another day.
//
//   SIXPOINT_CHECK(refuse_of_replay("replay:session.zip", "--certificate"));  // usage
//
// | what is done                               | a unit, also a virtual one | replay:           |
// |--------------------------------------------|----------------------------|-------------------|
// | jig: the run's kind in the store           | jig                        | replay            |
// | jig: constants and writes in the store     | yes                        | no                |
// | jig: counts for retests, locks, trends     | yes                        | no                |
// | jig: --certificate, --label, --study       | yes                        | refused           |
// | capture: constants in the store            | yes                        | no                |
// | capture: --constants-out                   | yes                        | refused           |
// | station                                    | yes                        | refused           |
//
// The answer of the command and its exit code are those of the session.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"

namespace sixpoint::cli {

inline constexpr const char* kReplayKind = "replay";

inline bool is_replay(std::string_view device) { return device.starts_with("replay:"); }

// usage where a replay would be taken for a measurement by this option, which was given.
inline Status refuse_of_replay(std::string_view device, const std::string& option) {
  return is_replay(device)
             ? fail(ErrorCode::usage, "a replayed session is no measurement", option,
                    "leave it out; a certificate, a label and constants are made with the unit")
             : Status();
}

}  // namespace sixpoint::cli
