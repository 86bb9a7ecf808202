// Who works at the stations of this machine, for the commands that ask for a PIN.
//
//   SIXPOINT_CHECK(sign_off(context, "Eve"));  // where operators are named, Eve's PIN is asked for
#pragma once

#include <string>

#include "cli/context.h"

namespace sixpoint::cli {

// operators.json in the user's data folder (station/access/operators.h).
std::string operators_file();

// A decision of an engineer. Where the machine has operators, the PIN of this one is read from
// standard input; permission where it is not an engineer's, or wrong. Without operators: anyone.
Status sign_off(Context& context, const std::string& name);

}  // namespace sixpoint::cli
