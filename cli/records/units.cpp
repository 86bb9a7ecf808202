// sixpoint units: the units in the store.
#include <string>

#include "cli/command.h"
#include "cli/people_text.h"
#include "cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct UnitsCommandOptions {
  std::string store;
  bool json = false;
};

Status run_units(const UnitsCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units, store.units());
  Json json = document("units");
  Json& list = json["units"] = Json::array();
  Columns table({"unit", "type", "first seen", "sets of constants"});
  for (const auto& unit : units) {
    list.push_back({{"serial", unit.serial},
                    {"model", unit.model},
                    {"first_seen", to_iso8601(unit.first_seen)},
                    {"constants", unit.constants}});
    table.row(
        {unit.serial, unit.model, local_time(unit.first_seen), std::to_string(unit.constants)});
  }
  return print_answer(context, options.json, json, table.text());
}

}  // namespace

void add_units(CLI::App& app, Context& context) {
  auto [command, options] = add_command<UnitsCommandOptions>(
      app, context, "units", "list the units in the store", run_units);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli
