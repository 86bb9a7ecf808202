// What a command works with, and how it answers: data on stdout, text for people on stderr, an exit
// code.
//
//   Status list_units(const std::string& location, bool as_json, Context& context) {
//     SIXPOINT_ASSIGN(auto store, open_existing_store(context, location));
//     SIXPOINT_ASSIGN(const auto units, store.units());
//     Json json = document("units");
//     json["units"] = units.size();
//     return print_answer(context, as_json, json, fmt::format("{} units\n", units.size()));
//   }
//
// A judgement (failed, inconclusive) goes into context.worsen(). One thread at a time uses a
// Context.
#pragma once

#include <chrono>
#include <istream>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <type_traits>

#include <nlohmann/json.hpp>

#include "base/env.h"
#include "base/result.h"
#include "base/time.h"

namespace spdlog {
class logger;
}

namespace sixpoint::cli {

// Keys keep the order in which they were added: `schema` comes first.
using Json = nlohmann::ordered_json;

// Exit codes beyond those of ErrorCode (contract: exit codes). With several inputs the worst wins.
inline constexpr int kExitPassed = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitInconclusive = 2;
inline constexpr int kExitStopped = 3;

struct Context {
  Env& env;
  std::ostream& out;     // standard output: the data that the command was asked for
  std::ostream& people;  // standard error: prompts, progress, warnings, errors
  std::istream& in;
  bool people_at_terminal = false;  // progress bars only when true
  bool out_is_taken = false;        // an output was named "-": text for people goes to `people`
  int exit_code = 0;
  std::shared_ptr<spdlog::logger> logger = nullptr;  // made by log() at its first use

  // Where the text of an answer goes.
  std::ostream& text() { return out_is_taken ? people : out; }

  // Warnings and errors: lines "sixpoint: ..." on `people`. Prompts, summaries and bars are written
  // to `people` directly.
  spdlog::logger& log();

  // Keeps the worse of two exit codes:
  //
  //   better                                             worse
  //   0 passed < 2 inconclusive < 1 failed < 3 stopped < 64 ... 78 errors, by their number
  void worsen(int code);
  void worsen(ErrorCode code) { worsen(static_cast<int>(code)); }

  // To be called last, where the answer is about a part of what was asked for: what is known so far
  // may not read as "done".
  //
  //   exit code so far              afterwards
  //   0 passed, 1 failed            2 inconclusive
  //   2 inconclusive, 3 stopped     the same
  //   64 ... 78 errors              the same
  void worsen_as_incomplete();
};

// The exit code of a command that a signal ended (stop_request.h):
//
//     signal                                             exit code
//     SIGINT (Ctrl-C), SIGHUP (the terminal is closed)   3, as everywhere
//     SIGTERM, the word of what supervises services      0
//     none (-1): the command ended by itself             0
int exit_of_stop(int signal);
void take_stop(Context& context, int signal);

// {"schema": "sixpoint/NAME/1"}, to which a command adds its keys.
Json document(std::string_view command);

// Writes a document to stdout, whole or not at all: the answer is there, so a signal that asks the
// program to stop (stop_request.h) comes too late and changes nothing. The program must not have
// threads that take it meanwhile. A reader that goes away (SIGPIPE) ends it as ever. Commands print
// their documents by this and what is below.
void write_document(Context& context, std::string_view text);

// Prints one JSON document and a line end on stdout. This and the next one give a success, for
// `return print_answer(...)` at the end of a command: run_program() reports an output that fails.
Status print_json(Context& context, const Json& json);

// The answer of a command on stdout: `json` with --json, else `text`.
Status print_answer(Context& context, bool as_json, const Json& json, std::string_view text);

// Prints the error for people ("sixpoint: where: what; hint") and keeps its exit code.
void report_error(Context& context, const Error& error);
// The same; with --json also a document with the key `error` {code, what, where, hint}.
void report_error(Context& context, std::string_view command, const Error& error, bool json);

Json error_to_json(const Error& error);

// A number for JSON: NaN and infinities become null, because JSON does not have them.
Json number(double value);

// The value, or null where there is none. A time is written as ISO 8601, UTC.
Json text_or_null(const std::string& text);
template <class Value>
Json value_or_null(const std::optional<Value>& value) {
  if (!value) {
    return nullptr;
  }
  if constexpr (std::is_same_v<Value, UtcTime>) {
    return to_iso8601(*value);
  } else {
    return *value;
  }
}

// The path of the program that runs; "sixpoint" where the system does not say.
std::string this_program();

// "1.2 GB": three digits at most, decimal.
std::string bytes_text(std::uint64_t bytes);

// A bar such as "repairing  [=====     ]  52 %  1.2 GB  2 failed  3.1 a second  00:12 left" on a
// terminal; elsewhere the same as a line a minute, for logs. Bytes and failures are left out where
// there are none.
class Progress {
 public:
  Progress(Context& context, std::string doing, std::uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void at(std::uint64_t done, std::uint64_t bytes = 0, std::uint64_t failed = 0);

 private:
  Context& context_;
  std::string doing_;
  std::uint64_t total_;
  int last_percent_ = -1;
  std::uint64_t last_failed_ = 0;
  std::chrono::nanoseconds start_;
};

}  // namespace sixpoint::cli
