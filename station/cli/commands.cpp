// The list of commands. A new command is one file, one line here and one in CMakeLists.txt.
#include "station/cli/command.h"

namespace sixpoint::cli {

// add_NAME is defined in NAME.cpp.
void add_audit(CLI::App& app, Context& context);
void add_history(CLI::App& app, Context& context);
void add_scan(CLI::App& app, Context& context);
void add_simulate(CLI::App& app, Context& context);
void add_units(CLI::App& app, Context& context);

const std::vector<CommandEntry>& commands() {
  static const std::vector<CommandEntry> kCommands = {
      {"scan", add_scan},
      {"units", add_units},
      {"history", add_history},
      {"audit", add_audit},
      {"simulate", add_simulate},
  };
  return kCommands;
}

}  // namespace sixpoint::cli
