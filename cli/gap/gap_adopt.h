// sixpoint gap adopt: what several diagnoses agree on goes into a scenario.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_adopt(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// Adds `adopt` under the command `gap`.
void add_gap_adopt(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
