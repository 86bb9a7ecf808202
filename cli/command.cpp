#include "cli/command.h"

namespace sixpoint::cli {

CLI::App& add_group(CLI::App& parent, const char* name, const char* about) {
  return *parent.add_subcommand(name, about)->require_subcommand(1);
}

}  // namespace sixpoint::cli
