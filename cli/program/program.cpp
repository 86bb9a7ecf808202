#include "cli/program/program.h"

#include <algorithm>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>
#include <spdlog/logger.h>

#include "base/thrown.h"
#include "cli/program/examples.h"
#include "cli/program/option_values.h"
#include "cli/program/suggestion.h"
#include "station/records/software.h"

namespace sixpoint::cli {

namespace {

// "store export" below `app`.
CLI::App& command_of(CLI::App& app, std::string_view path) {
  CLI::App* command = &app;
  while (!path.empty()) {
    const std::size_t end = std::min(path.find(' '), path.size());
    command = command->get_subcommand(std::string(path.substr(0, end)));
    path.remove_prefix(std::min(end + 1, path.size()));
  }
  return *command;
}

}  // namespace

void declare_commands(CLI::App& app, Context& context) {
  for (const CommandEntry& entry : commands()) {
    entry.add(app, context);
  }
  for (const CommandExamples& of : command_examples()) {
    command_of(app, of.command)
        .footer(fmt::format("Examples:\n  {}\n", fmt::join(of.lines, "\n  ")));
  }
  refuse_unusable_values(app);
}

namespace {

// As it was typed, as far as it was understood: sixpoint store export.
std::string words_of_command(const CLI::App& app) {
  std::string words = app.get_name();
  for (const CLI::App* command : app.get_subcommands()) {
    words += " " + words_of_command(*command);
  }
  return words;
}

// With --json also as the document of the command that was chosen.
void report_for_chosen(const CLI::App& app, const std::vector<std::string>& arguments,
                       const Error& error, Context& context) {
  std::string schema;
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    // The documents of a group have its name, but for those of gap: gap-diagnose.
    if (schema.empty()) {
      schema = command->get_name();
    } else if (schema == "gap") {
      schema += "-" + command->get_name();
    }
  }
  report_error(context, schema, error,
               command->get_option_no_throw("--json") != nullptr &&
                   std::ranges::find(arguments, "--json") != arguments.end());
}

// A command line that is not understood.
void report_usage(const CLI::App& app, const std::vector<std::string>& arguments,
                  const CLI::ParseError& refused, Context& context) {
  Error error{ErrorCode::usage, plain_words(refused), "",
              fmt::format("'{} --help' lists what there is", words_of_command(app))};
  if (auto unknown = unknown_word(app, arguments)) {
    error.what = *std::move(unknown);
    error.hint.clear();
  }
  report_for_chosen(app, arguments, error, context);
}

}  // namespace

int run_program(const std::vector<std::string>& arguments, Context& context) {
  CLI::App app("Sixpoint measures the constants of activity monitors and repairs their recordings.",
               "sixpoint");
  // Before the commands: they take it over.
  app.set_help_flag("-h,--help", "print this text");
  app.set_version_flag("--version", station::software_name(), "print the version");
  app.require_subcommand(1);
  app.failure_message(CLI::FailureMessage::simple);
  declare_commands(app, context);
  app.footer(
      "First steps, without any device:\n"
      "  sixpoint jig --device virtual:seed=7,jig=auto --store bench.db\n"
      "  sixpoint station --device virtual:seed=7,pace=real --store bench.db\n"
      "'sixpoint COMMAND --help' lists the options of a command.\n");
  // CLI11 takes the arguments in reverse order.
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  context.exit_code = 0;
  context.out_is_taken = false;
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) {
      report_usage(app, arguments, error, context);
      return context.exit_code;
    }
    app.exit(error, context.out, context.people);  // --help, --version
  } catch (const std::exception& error) {
    report_for_chosen(app, arguments, error_of(error), context);
  }
  context.out.flush();
  if (!context.out) {
    context.log().error(
        "standard output could not be written; see that it is open and that its disk has space");
    return static_cast<int>(ErrorCode::io);
  }
  return context.exit_code;
}

}  // namespace sixpoint::cli
