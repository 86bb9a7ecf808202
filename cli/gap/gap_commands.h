// The subcommands of `sixpoint gap`, a file each.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_challenge(*gap, context);
//   add_gap_trends(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// `challenge`: the diagnosis on units whose effects it is not told.
void add_gap_challenge(CLI::App& gap_command, Context& context);

// `score`: measures of a program's answers, with intervals (gap/benchmark/benchmark_score.h).
void add_gap_score(CLI::App& gap_command, Context& context);

// `answers`: what a method of this project answers to the bundles of an export.
void add_gap_answers(CLI::App& gap_command, Context& context);

// `trends`: whether a skew belongs to the units, the jig or the station.
void add_gap_trends(CLI::App& gap_command, Context& context);

// `adopt`: what several diagnoses agree on goes into a scenario.
void add_gap_adopt(CLI::App& gap_command, Context& context);

// `report`: how the gap shrank with each adoption.
void add_gap_report(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
