// The one error type of the project.
//
//   const Error error{ErrorCode::bad_data, "not a zip archive", "unit.gt3x", "download it again"};
//   error.brief();  // "unit.gt3x: not a zip archive; download it again"
//
// An error says what happened, where (a file, an offset, a device), and what a person can do next.
// Libraries never print and never exit; they return Result<T> (result.h) with one of these inside.
#pragma once

#include <string>
#include <string_view>

namespace sixpoint {

// Kinds of failure, by what the person in front of the program has to do about it. The values are
// the exit codes of the command line's contract (BSD sysexits), so that no second table exists.
enum class ErrorCode {
  usage = 64,               // the command line is wrong
  bad_data = 65,            // the input is damaged or is not what it claims to be
  no_input = 66,            // the input does not exist or cannot be opened
  device_unavailable = 69,  // no such unit, or it went away
  internal = 70,            // a defect of this program
  cannot_create = 73,       // an output cannot be made
  io = 74,                  // reading or writing failed half-way
  permission = 77,          // the operating system refuses
  configuration = 78,       // a configuration file contradicts itself
};

// A short stable name such as "bad_data", for JSON.
std::string_view to_string(ErrorCode code);

// Is a number that was read from a file one of the kinds above?
bool is_error_code(int number);

struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string what;   // what happened, one sentence without a full stop
  std::string where;  // file, record offset, device; empty where there is no place
  std::string hint;   // what to do next; empty only where nothing can be done

  // "where: what; hint" on one line. Control characters that came from outside are escaped.
  std::string brief() const;
};

// Text from outside (serial numbers, file names, replies) made safe for one line of a terminal:
// control characters become \xNN, and more than `limit` bytes are cut with "...".
std::string printable(std::string_view text, std::size_t limit = 400);

}  // namespace sixpoint
