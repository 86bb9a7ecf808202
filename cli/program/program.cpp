#include "cli/program/program.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <spdlog/logger.h>

#include "station/records/software.h"

namespace sixpoint::cli {

int run_program(const std::vector<std::string>& arguments, Context& context) {
  CLI::App app("Sixpoint measures the constants of activity monitors and repairs their recordings.",
               "sixpoint");
  app.set_version_flag("--version", station::software_name());
  app.require_subcommand(1);
  app.footer(
      "First steps, without any device:\n"
      "  sixpoint jig --device virtual:seed=7,jig=auto --store bench.db\n"
      "  sixpoint station --device virtual:seed=7,pace=real --store bench.db\n"
      "'sixpoint COMMAND --help' lists the options of a command.");
  app.failure_message(CLI::FailureMessage::simple);
  for (const CommandEntry& entry : commands()) {
    entry.add(app, context);
  }
  // CLI11 takes the arguments in reverse order.
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  context.exit_code = 0;
  context.out_is_taken = false;
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      return app.exit(error, context.out, context.people);
    }
    context.log().error("{}; 'sixpoint --help' and 'sixpoint COMMAND --help' list what there is",
                        printable(error.what()));
    return static_cast<int>(ErrorCode::usage);
  } catch (const std::exception& error) {
    // The libraries return errors as values: an exception is a defect of this program.
    context.log().critical("internal error: {}; please report it with the command line",
                           printable(error.what()));
    return static_cast<int>(ErrorCode::internal);
  }
  context.out.flush();
  if (!context.out) {
    context.log().error("standard output could not be written; free some space");
    return static_cast<int>(ErrorCode::io);
  }
  return context.exit_code;
}

}  // namespace sixpoint::cli
