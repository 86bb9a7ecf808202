// How a command is declared. A command is one file with one function add_NAME(app, context), which
// declares the options and names the function that does the work:
//
//   struct Options { std::string store; bool json = false; };
//
//   Status run(const Options& options, Context& context) {
//     SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
//     return print_answer(context, options.json, document("units"), "a store\n");
//   }
//
//   void add_units(CLI::App& app, Context& context) {
//     auto [command, options] =
//         add_command<Options>(app, context, "units", "list the units in the store", run);
//     add_store_option(command, options.store);
//   }
//
// An error that run() returns is reported and becomes the exit code. Commands hold no state between
// calls: a test can run the whole program many times in one process.
#pragma once

#include <memory>
#include <string_view>

#include <CLI/App.hpp>
// For context.log().
#include <spdlog/logger.h>

#include "cli/context.h"

namespace sixpoint::cli {

// A command that was declared, and its options.
template <class Options>
struct Declared {
  CLI::App& command;
  Options& options;
};

// Declares a command (below `parent`), and --json where `Options` has a field of that name. When
// the user chose it, `work(options, context)` runs. `schema`: the name in an error document.
template <class Options, class Work>
Declared<Options> add_command(CLI::App& parent, Context& context, std::string_view schema,
                              const char* name, const char* about, Work work) {
  CLI::App* command = parent.add_subcommand(name, about);
  const auto options = std::make_shared<Options>();
  const bool* as_json = nullptr;
  if constexpr (requires { options->json; }) {
    command->add_flag("--json", options->json, "one JSON document on stdout");
    as_json = &options->json;
  }
  command->callback([options, work, schema, as_json, &context] {
    if (const Status done = work(*options, context); !done) {
      report_error(context, schema, done.error(), as_json != nullptr && *as_json);
    }
  });
  return {*command, *options};
}
template <class Options, class Work>
Declared<Options> add_command(CLI::App& parent, Context& context, const char* name,
                              const char* about, Work work) {
  return add_command<Options>(parent, context, name, name, about, work);
}

// The check of an option that takes a number greater than 0. CLI11's own (PositiveNumber) names the
// largest number there is in its message, with all of its 309 digits.
CLI::Validator greater_than_zero();

// Declares a command that is a name for its subcommands.
CLI::App& add_group(CLI::App& parent, const char* name, const char* about);

}  // namespace sixpoint::cli
