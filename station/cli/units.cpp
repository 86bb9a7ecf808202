// sixpoint units: the units that the store knows.
#include <fmt/format.h>

#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string store;
  bool json = false;
};

void run(const Options& options, Context& context) {
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return report_error(context, "units", store.error(), options.json);
  }
  const auto units = store->units();
  if (!units) {
    return report_error(context, "units", units.error(), options.json);
  }
  if (options.json) {
    Json answer = document("units");
    answer["units"] = Json::array();
    for (const auto& unit : *units) {
      answer["units"].push_back({{"serial", unit.serial},
                                 {"model", unit.model},
                                 {"first_seen", to_iso8601(unit.first_seen)},
                                 {"constants", unit.constants}});
    }
    return print_json(context, answer);
  }
  for (const auto& unit : *units) {
    context.out << fmt::format("{:<16} {:<18} first seen {}  {} sets of constants\n", unit.serial,
                               unit.model, to_iso8601(unit.first_seen), unit.constants);
  }
}

}  // namespace

void add_units(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("units", "List the units in the store");
  auto options = std::make_shared<Options>();
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli
