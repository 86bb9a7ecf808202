// The list of commands. A new command is one file in the room of its kind, one line in the list and
// one in that room's CMakeLists.txt.
#include "cli/program/program.h"

namespace sixpoint::cli {

// In the order in which --help lists them: reading and repairing files, measuring units, the store,
// the simulator. add_NAME is defined in NAME.cpp.
// clang-format off
#define SIXPOINT_COMMANDS(COMMAND) \
  COMMAND(inspect)                 \
  COMMAND(scan)                    \
  COMMAND(repair)                  \
  COMMAND(export)                  \
  COMMAND(compare)                 \
  COMMAND(impact)                  \
  COMMAND(solve)                   \
  COMMAND(jig)                     \
  COMMAND(capture)                 \
  COMMAND(limits)                  \
  COMMAND(certificate)             \
  COMMAND(check_unit)              \
  COMMAND(station_lock)            \
  COMMAND(retest)                  \
  COMMAND(operator)                \
  COMMAND(statistics)              \
  COMMAND(gage_rr)                 \
  COMMAND(units)                   \
  COMMAND(history)                 \
  COMMAND(audit)                   \
  COMMAND(store)                   \
  COMMAND(simulate)                \
  COMMAND(session)                 \
  COMMAND(devices)                 \
  COMMAND(doctor)                  \
  COMMAND(virtual)                 \
  COMMAND(station)                 \
  COMMAND(archive)                 \
  COMMAND(gap)
// clang-format on

#define SIXPOINT_DECLARE(name) void add_##name(CLI::App& app, Context& context);
SIXPOINT_COMMANDS(SIXPOINT_DECLARE)
#undef SIXPOINT_DECLARE

const std::vector<CommandEntry>& commands() {
#define SIXPOINT_ENTRY(name) {#name, add_##name},
  static const std::vector<CommandEntry> kCommands = {SIXPOINT_COMMANDS(SIXPOINT_ENTRY)};
#undef SIXPOINT_ENTRY
  return kCommands;
}

}  // namespace sixpoint::cli
