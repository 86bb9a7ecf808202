// What every command of the program is given, and how it answers.
//
// A command lives in its own file with one function add_NAME(app, context), which declares its
// options on `app` and sets a callback. The callback does the work, prints through this header and
// leaves the exit code in context.exit_code. Commands hold no state between calls, so that tests
// can run the whole program many times in one process (run_program()).
#pragma once

#include <istream>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <spdlog/logger.h>

#include "base/env.h"
#include "base/error.h"

namespace sixpoint::cli {

// Keys keep the order in which they were written: `schema` comes first.
using Json = nlohmann::ordered_json;

// Exit codes beyond those of ErrorCode (contract: exit codes). With several inputs the worst wins.
inline constexpr int kExitPassed = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitInconclusive = 2;
inline constexpr int kExitStopped = 3;

struct Context {
  Env& env;
  std::ostream& out;     // data: what the command was asked for
  std::ostream& people;  // prompts, progress, warnings, errors
  std::istream& in;
  bool people_at_terminal = false;  // bars and colours only when true
  int exit_code = 0;
  std::shared_ptr<spdlog::logger> logger = nullptr;  // made by log() at its first use

  // For warnings and errors: lines "sixpoint: ..." on `people`, through spdlog. What a person reads
  // as part of the work (prompts, summaries, bars) goes to `people` as it is.
  spdlog::logger& log();

  // Keeps the worse of two exit codes: 0 < 2 < 1 < 3 < 64 and above.
  void worsen(int code);
};

// {"schema": "sixpoint/NAME/1"}, to which a command adds its keys.
Json document(std::string_view command);

// Prints one JSON document and a line end on stdout.
void print_json(Context& context, const Json& json);

// Says the error to people ("sixpoint: where: what; hint"), keeps its exit code, and in JSON mode
// prints a document with the one key `error` {code, what, where, hint}.
void report_error(Context& context, std::string_view command, const Error& error, bool json);

Json error_to_json(const Error& error);

// A number for JSON: NaN and infinities, which JSON has not, become null.
Json number(double value);

// A bar such as "repairing  [=====>    ]  52 %  ETA 00:12" on a terminal, nothing elsewhere.
class Progress {
 public:
  Progress(Context& context, std::string doing, std::uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void at(std::uint64_t done);

 private:
  Context& context_;
  std::string doing_;
  std::uint64_t total_;
  int last_percent_ = -1;
  std::chrono::nanoseconds start_;
};

// The commands, in the order in which `sixpoint --help` lists them.
struct CommandEntry {
  std::string_view name;
  void (*add)(CLI::App& app, Context& context);
};
const std::vector<CommandEntry>& commands();

// The whole program: parses, runs, returns the exit code. `arguments` without the program's name.
int run_program(const std::vector<std::string>& arguments, Context& context);

}  // namespace sixpoint::cli
