// sixpoint gap score and gap answers: a benchmark that any program can enter.
//
//   CLI::App* const gap = app.add_subcommand("gap", "simulator against recording");
//   add_gap_score(*gap, context);
//   add_gap_answers(*gap, context);
#pragma once

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// `score`: measures of a program's answers, with intervals (gap/benchmark/benchmark_score.h).
void add_gap_score(CLI::App& gap_command, Context& context);

// `answers`: what a method of this project answers to the bundles of an export.
void add_gap_answers(CLI::App& gap_command, Context& context);

}  // namespace sixpoint::cli
