// Ctrl-C, SIGTERM, SIGHUP and SIGPIPE in a command that does not take them itself
// (cli/stop_request.h): exit 3. Of SIGPIPE nothing is said, since the reader has gone, as `head`
// does.
//
//   take_interrupts({"export", "archive"});  // prints "sixpoint export archive" when it comes
//
// Results appear whole or not at all, and temporary files are removed:
//
// | command                 | says                                                       |
// |-------------------------|------------------------------------------------------------|
// | archive plan            | no plan was made                                           |
// | scan, inspect, simulate | nothing was written: they write at their end               |
// | capture                 | begin it again: the unit may still be recording            |
// | gap challenge --export  | remove the folder and begin again: it must be empty        |
// | export -o,              | what is done stays, and this line begins again: the line   |
// | store export --csv      | with --force, since the folder is not empty any more       |
// | repair                  | what is done stays, and this line goes on: with --resume   |
// | others                  | what is done stays, and this line goes on: the line        |
//
// A file that grows beyond the limit of a file's size (ulimit -f: SIGXFSZ) does not end the program:
// the write fails as on a full disk, exit 74.
//
// In the background of a script, where the signal is ignored, it stays so.
#pragma once

#include <string>
#include <vector>

namespace sixpoint::cli {

std::string text_when_stopped(const std::vector<std::string>& arguments);

// Once, before threads are started.
void take_interrupts(const std::vector<std::string>& arguments);

}  // namespace sixpoint::cli
