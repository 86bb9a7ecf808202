// sixpoint gap challenge: the project's own blind check of `gap diagnose`.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_challenge(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// Adds `challenge` under the command `gap`.
void add_gap_challenge(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
