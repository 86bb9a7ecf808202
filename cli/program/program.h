// The whole program: its commands, and one run of it.
//
//   std::ostringstream out;
//   Context context{env, out, std::cerr, std::cin};
//   const int exit_code = run_program({"inspect", path, "--json"}, context);
//
// A command is defined in one of the rooms below; commands.cpp lists all of them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// The commands, in the order in which `sixpoint --help` lists them.
struct CommandEntry {
  std::string_view name;
  void (*add)(CLI::App& app, Context& context);
};
const std::vector<CommandEntry>& commands();

// Declares all of them, each with its examples (examples.h).
void declare_commands(CLI::App& app, Context& context);

// Parses, runs, returns the exit code. `arguments` do not hold the program's name. No state is left
// behind: a test calls it many times in one process.
int run_program(const std::vector<std::string>& arguments, Context& context);

}  // namespace sixpoint::cli
