// sixpoint gap trends: whether a skew belongs to the units, the jig or the station.
#pragma once

#include <CLI/App.hpp>

#include "station/cli/command.h"

namespace sixpoint::cli {

void add_gap_trends(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
