// Who works at the stations of this machine, for the commands that ask for a PIN.
//
//   SIXPOINT_CHECK(sign_off(context, "Eve"));  // where operators are named, Eve's PIN is asked for
#pragma once

#include <string>

#include "cli/context.h"
#include "station/access/operators.h"

namespace sixpoint::cli {

// operators.json in the user's data folder (station/access/operators.h).
std::string operators_file();

// A decision of an engineer. Where the machine has operators, the PIN of this one is read from
// standard input; permission where it is not an engineer's, or wrong. Without operators: anyone.
Status sign_off(Context& context, const std::string& name);

// Who measures. Where the machine has operators, `name` must be one, and the PIN is the first line
// of `pin_file`, or asked for at the terminal, without echo; permission where it is wrong. Without
// operators: the name as it was given, and not authenticated.
//
// | operators | --operator                | PIN                      | answer                      |
// |-----------|---------------------------|--------------------------|-----------------------------|
// | none      | any                       | not asked                | the name, not authenticated |
// | some      | one of them               | right                    | the name, authenticated     |
// | some      | one of them               | wrong, or none was given | permission                  |
// | some      | not one of them, or empty | any                      | permission                  |
Result<station::SignedName> who_measures(Context& context, const std::string& name,
                                         const std::string& pin_file);

}  // namespace sixpoint::cli
