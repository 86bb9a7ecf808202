// The list of commands. A new command is one file, one line here and one in CMakeLists.txt.
#include "station/cli/command.h"

namespace sixpoint::cli {

// add_NAME is defined in NAME.cpp.

const std::vector<CommandEntry>& commands() {
  static const std::vector<CommandEntry> kCommands = {};
  return kCommands;
}

}  // namespace sixpoint::cli
