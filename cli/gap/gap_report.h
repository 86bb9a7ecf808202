// sixpoint gap report: the gap over time, before and after each adoption.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_report(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// Adds `report` under the command `gap`.
void add_gap_report(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
