// sixpoint gap challenge: the project's own blind check of `gap diagnose`.
#pragma once

#include <CLI/App.hpp>

#include "station/cli/command.h"

namespace sixpoint::cli {

// Adds `challenge` under the command `gap`.
void add_gap_challenge(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
