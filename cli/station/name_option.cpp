#include "cli/station/name_option.h"

#include "db/name_rule.h"

namespace sixpoint::cli {

Status check_name_option(const char* option, const std::string& text) {
  // A line break would be another line of a certificate.
  if (printable(text, text.size()) != text) {
    return fail(ErrorCode::usage, "a name has no control characters", option,
                "give it on one line");
  }
  const Status taken = db::check_name(text);
  return taken ? Status() : fail(ErrorCode::usage, taken.error().what, option, taken.error().hint);
}

}  // namespace sixpoint::cli
