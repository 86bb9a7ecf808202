// sixpoint gap trends: whether a skew belongs to the units, the jig or the station.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_trends(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

void add_gap_trends(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
