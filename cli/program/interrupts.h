// Ctrl-C, SIGTERM and SIGHUP in a command that does not take them itself (cli/stop_request.h):
// exit 3.
//
//   take_interrupts({"scan", "archive"});  // prints "sixpoint scan archive" when it comes
//
// Results appear whole or not at all, so what is done stays, temporary files are removed, and the
// same line goes on. In the background of a script, where the signal is ignored, it stays so.
#pragma once

#include <string>
#include <vector>

namespace sixpoint::cli {

// Once, before threads are started.
void take_interrupts(const std::vector<std::string>& arguments);

}  // namespace sixpoint::cli
