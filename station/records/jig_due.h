// The jig is calibrated too: after its due date no run passes, unless an engineer signed for it.
//
//   SIXPOINT_ASSIGN(const JigDue jig, parse_jig_due("2027-03-31", "laboratory closed", "Eve"));
//   SIXPOINT_CHECK(check_jig_due(jig, env.clock.now()));
//
// | due date         | exception | signed by | answer                                           |
// |------------------|-----------|-----------|--------------------------------------------------|
// | any              | a reason  | no one    | usage error of parse_jig_due(): an exception has |
// |                  |           |           | a name, also before it is needed                 |
// | not known        | any       | any       | the unit may be measured                         |
// | that day, before | any       | any       | the unit may be measured                         |
// | a day before     | none      | any       | configuration error: nothing is measured         |
// | a day before     | a reason  | a name    | the unit may be measured; jig_due_note() goes    |
// |                  |           |           | into the run's record                            |
//
// It is asked when a run starts, and again when one goes on that another program left. A run that
// started in time may end after midnight.
//
// The due date is a day in UTC, and counts to its end.
//
// Pure functions.
#pragma once

#include <optional>
#include <string>

#include "base/result.h"
#include "base/time.h"

namespace sixpoint::station {

struct JigDue {
  std::optional<UtcTime> due;
  std::string exception;  // why it may be used all the same; empty: it may not
  std::string signed_by;  // the engineer's name; not empty where there is an exception
};

// `due` as a person writes it ("2027-03-31"), or empty; usage where it is no date, or where no one
// signs for the exception.
Result<JigDue> parse_jig_due(const std::string& due, const std::string& exception,
                             const std::string& signed_by);
Status check_jig_due(const JigDue& jig, UtcTime now);
// The signed exception in one sentence, for the run's record; empty where none is needed.
std::string jig_due_note(const JigDue& jig, UtcTime now);

}  // namespace sixpoint::station
