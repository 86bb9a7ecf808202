// sixpoint gap report SOURCE... --scenario S -o report.html: how the gap shrank with each adoption.
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/gap/gap_sources.h"
#include "cli/output.h"
#include "gap/adopt/progress.h"

namespace sixpoint::cli {
namespace {

struct GapReportCommandOptions {
  SourceOptions sources;
  std::string scenario;
  std::string output;
  OutputOptions outputs;
  bool json = false;
};

std::string progress_text(const gap::GapProgress& progress) {
  std::string text = progress.brief() + "\n";
  for (const gap::EffectProgress& effect : progress.effects) {
    text += effect.scatter
                ? fmt::format("  {:<20} scatter, which can't be predicted\n", effect.name)
                : fmt::format("  {:<20} closes: {}  ({:.2f} mg without it)\n", effect.name,
                              effect.closed.text(), effect.without_mg);
  }
  for (const gap::BundleProgress& bundle : progress.bundles) {
    text += fmt::format("  {}: {:.2f} mg -> {:.2f} mg, floor {:.2f} mg{}{}\n",
                        printable(bundle.name), bundle.before_mg,
                        bundle.after_mg.empty() ? bundle.before_mg : bundle.after_mg.back(),
                        bundle.floor_mg, bundle.learnt_from ? ", learnt from" : "",
                        bundle.unknown ? ", something unknown" : "");
  }
  return text;
}

Status run_gap_report(const GapReportCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(guard_sources(outputs, options.sources));
  SIXPOINT_CHECK(outputs.input(options.scenario));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  SIXPOINT_ASSIGN(const Bytes scenario, read_file(context.env.files, options.scenario));
  SIXPOINT_ASSIGN(gap::ScenarioHistory history, gap::adoption_history(as_text(scenario)));
  SIXPOINT_ASSIGN(const auto sources, find_sources(context, options.sources));
  gap::ProgressRecorder recorder(std::move(history));
  Progress bar(context, "simulating", sources.size());
  std::size_t done = 0;
  for (const GapSource& source : sources) {
    SIXPOINT_ASSIGN(const gap::RecordedBundle recorded, record_of_source(context, source));
    SIXPOINT_CHECK(recorder.add(source.name, recorded));
    bar.at(++done);
  }
  const gap::GapProgress progress = recorder.finish();
  if (!options.output.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.output, gap::progress_html(progress)));
  }
  for (const std::string& loss : progress.losses) {
    context.people << "sixpoint: " << printable(loss, 1000) << '\n';
  }
  context.worsen(progress.usable() ? kExitPassed : kExitInconclusive);
  Json json = document("gap-report");
  json.update(progress.to_json());
  return print_answer(context, options.json, json, progress_text(progress));
}

}  // namespace

void add_gap_report(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapReportCommandOptions>(
      gap_command, context, "gap-report", "report",
      "the gap over time: before, after each adoption of a scenario, and its floor",
      run_gap_report);
  add_source_options(command, options.sources, "SOURCE", "bundles, folders of bundles, stores");
  command.add_option("--scenario", options.scenario, "the scenario that `gap adopt` made")
      ->required();
  command.add_option("-o,--output", options.output, "write the report as one page to this file");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
