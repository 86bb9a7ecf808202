// sixpoint units: the units in the store.
#include <fmt/format.h>

#include "cli/command.h"
#include "cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string store;
  bool json = false;
};

Status run(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units, store.units());
  Json json = document("units");
  Json& list = json["units"] = Json::array();
  std::string text;
  for (const auto& unit : units) {
    list.push_back({{"serial", unit.serial},
                    {"model", unit.model},
                    {"first_seen", to_iso8601(unit.first_seen)},
                    {"constants", unit.constants}});
    text += fmt::format("{:<16} {:<18} first seen {}  {} sets of constants\n", unit.serial,
                        unit.model, to_iso8601(unit.first_seen), unit.constants);
  }
  return print_answer(context, options.json, json, text);
}

}  // namespace

void add_units(CLI::App& app, Context& context) {
  auto [command, options] =
      add_command<Options>(app, context, "units", "list the units in the store", run);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli
