#include "station/records/jig_due.h"

#include <chrono>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

// The whole day counts.
bool is_over(const JigDue& jig, UtcTime now) {
  return jig.due && std::chrono::floor<std::chrono::days>(*jig.due) <
                        std::chrono::floor<std::chrono::days>(now);
}

}  // namespace

Result<JigDue> parse_jig_due(const std::string& due, const std::string& exception,
                             const std::string& signed_by) {
  JigDue jig{{}, exception, signed_by};
  if (!due.empty()) {
    const auto date = parse_iso8601(due);
    if (!date) {
      return fail(ErrorCode::usage, date.error().what, "--jig-due", "write it as 2027-03-31");
    }
    jig.due = *date;
  }
  if (!exception.empty() && signed_by.empty()) {
    return fail(ErrorCode::usage, "an exception for the jig has a name", "--jig-exception",
                "say who signs for it with --jig-exception-by NAME");
  }
  return jig;
}

Status check_jig_due(const JigDue& jig, UtcTime now) {
  if (!is_over(jig, now)) {
    return {};
  }
  if (jig.exception.empty()) {
    return fail(ErrorCode::configuration,
                fmt::format("the jig was due for its own calibration on {}",
                            to_iso8601(*jig.due).substr(0, 10)),
                {},
                "have it calibrated; or an engineer signs: --jig-exception WHY "
                "--jig-exception-by NAME");
  }
  return {};
}

std::string jig_due_note(const JigDue& jig, UtcTime now) {
  return is_over(jig, now) && !jig.exception.empty()
             ? fmt::format("the jig was due for its own calibration on {}; {} signed: {}",
                           to_iso8601(*jig.due).substr(0, 10), printable(jig.signed_by, 60),
                           printable(jig.exception, 200))
             : std::string();
}

}  // namespace sixpoint::station
