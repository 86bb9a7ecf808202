// sixpoint gap diagnose BUNDLE: where simulator and recording differ, and which effect explains it.
#include <chrono>
#include <memory>
#include <set>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/gap/recorded_scenario.h"
#include "cli/output.h"
#include "cli/store_option.h"
#include "gap/adopt/learnt_sizes.h"
#include "gap/judge/diagnose.h"
#include "gap/recording/bundle.h"
#include "gap/report/report_html.h"
#include "gap/report/report_sheet.h"
#include "gap/unguided/plain.h"
#include "gap/unguided/readings_table.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::cli {
namespace {

struct GapCommandOptions {
  std::string bundle;
  std::string run;
  std::string store;
  std::string population;
  std::vector<std::string> without;
  double matters_mg = gap::DiagnoseOptions{}.matters_mg;
  std::string html;
  std::string png;
  std::string pdf;
  std::string scenario_out;
  OutputOptions outputs;
  std::uint64_t seed = 0;
  double rate_hz = 0;  // 0: not given
  bool json = false;
};

int exit_code_of(const gap::Diagnosis& diagnosis) {
  if (!diagnosis.usable()) {
    return kExitInconclusive;
  }
  return diagnosis.verdict == gap::Verdict::no_gap || diagnosis.verdict == gap::Verdict::explained
             ? kExitPassed
             : kExitFailed;
}

struct Judged {
  gap::Diagnosis diagnosis;
  Json scenario;
};

Result<Judged> judged(Result<gap::Diagnosis> diagnosis) {
  if (!diagnosis) {
    return fail(diagnosis.error());
  }
  Json scenario = gap::augmented_scenario(*diagnosis);
  return Judged{*std::move(diagnosis), std::move(scenario)};
}

Result<Judged> judged(const gap::Bundle& bundle, const gap::DiagnoseOptions& how) {
  SIXPOINT_ASSIGN(gap::Diagnosis diagnosis, gap::diagnose(bundle, how));
  Json scenario = recorded_scenario(diagnosis, bundle);
  return Judged{std::move(diagnosis), std::move(scenario)};
}

Result<Judged> diagnose_input(const GapCommandOptions& options, gap::DiagnoseOptions how,
                              Context& context) {
  FileSystem& files = context.env.files;
  if (!options.run.empty()) {
    SIXPOINT_ASSIGN(db::Store store, open_existing_store(context, options.store));
    SIXPOINT_ASSIGN(const station::StoredRun run, station::stored_run(store, options.run));
    SIXPOINT_ASSIGN(const std::string samples, station::samples_of_run(store, run.id));
    SIXPOINT_ASSIGN(const gap::Bundle bundle, station::bundle_of_run(run, samples));
    how.uncalibrated = true;
    return judged(bundle, how);
  }
  SIXPOINT_ASSIGN(const FileInfo info, files.info(options.bundle));
  if (info.is_folder) {
    SIXPOINT_ASSIGN(const gap::Bundle bundle, gap::read_bundle(files, options.bundle));
    return judged(bundle, how);
  }
  if (!options.scenario_out.empty()) {
    return fail(ErrorCode::usage, "a recording without a protocol can't be simulated again",
                options.bundle, "leave --scenario-out out, or record a bundle (docs/gap.md)");
  }
  if (gap::is_readings_table(options.bundle)) {
    gap::ReadingsTableOptions table;
    table.rate_hz = options.rate_hz;
    return judged(gap::diagnose_table(files, options.bundle, how, table));
  }
  return judged(gap::diagnose_plain(files, options.bundle, how));
}

Result<Judged> diagnose(const GapCommandOptions& options, Context& context) {
  const auto start = context.env.clock.elapsed();
  gap::DiagnoseOptions how;
  how.without = std::set<std::string>(options.without.begin(), options.without.end());
  how.matters_mg = options.matters_mg;
  how.seed = options.seed;
  if (!options.population.empty()) {
    SIXPOINT_ASSIGN(const Bytes scenario, read_file(context.env.files, options.population));
    auto learnt = gap::learnt_sizes(as_text(scenario));
    if (!learnt) {
      Error error = std::move(learnt).error();
      error.where = printable(options.population) + ": " + error.where;
      return fail(std::move(error));
    }
    how.learnt = *std::move(learnt);
  }
  SIXPOINT_ASSIGN(Judged answer, diagnose_input(options, std::move(how), context));
  answer.diagnosis.seconds =
      std::chrono::duration<double>(context.env.clock.elapsed() - start).count();
  return answer;
}

void print_gap(const gap::Diagnosis& d, bool is_run, Context& context) {
  // The name of a run is "run ID" (station/records/jig_bundle.h).
  const std::string name = is_run ? d.bundle.substr(0, d.bundle.find(' ') + 1 + 12) : d.bundle;
  context.text() << fmt::format("{}: {}\n", printable(name), printable(d.brief(), 2000));
  for (const gap::EffectFinding& effect : d.effects) {
    context.text() << fmt::format("  {:<20} p {:.3f}  matters {:.3f}  held out {:+.1f} nats",
                                  effect.name, effect.probability, effect.probability_it_matters,
                                  effect.held_out_gain_nats);
    for (const gap::NamedValue& p : effect.all_parameters()) {
      context.text() << fmt::format("  {} {:.4g}", p.name, fmt::join(p.value, " "));
      context.text() << (p.sd.empty()
                             ? ""
                             : fmt::format(" +- {}", fmt::join(gap::uncertainty_texts(p), " ")));
    }
    context.text() << (effect.outside_datasheet ? "  (outside the datasheet)\n" : "\n");
  }
  for (const std::string& why : d.unknown.why) {
    context.text() << "  unknown: " << printable(why, 300) << '\n';
  }
  for (const gap::NextSegment& next : d.next_segments) {
    context.text() << fmt::format("  next: {} ({:.0f} min) would show {}\n", next.name,
                                  next.minutes, fmt::join(next.separates, ", "));
  }
  for (const std::string& loss : d.losses) {
    context.people << "sixpoint: " << printable(loss, 1000) << '\n';
  }
}

Status take_outputs(const GapCommandOptions& options, Outputs& outputs) {
  SIXPOINT_CHECK(outputs.input(options.bundle));
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.input(options.population));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  SIXPOINT_CHECK(outputs.file("--png", options.png));
  SIXPOINT_CHECK(outputs.file("--pdf", options.pdf));
  return outputs.file("--scenario-out", options.scenario_out);
}

Status write_reports(const GapCommandOptions& options, const Judged& answer, FileSystem& files) {
  const gap::Diagnosis& diagnosis = answer.diagnosis;
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(files, options.html, gap::report_html(diagnosis)));
  }
  if (!options.png.empty()) {
    SIXPOINT_ASSIGN(const Bytes png, gap::sheet_png(gap::report_sheet(diagnosis)));
    SIXPOINT_CHECK(write_file(files, options.png, as_text(png)));
  }
  if (!options.pdf.empty()) {
    SIXPOINT_ASSIGN(const Bytes pdf, gap::sheet_pdf(gap::report_sheet(diagnosis)));
    SIXPOINT_CHECK(write_file(files, options.pdf, as_text(pdf)));
  }
  if (!options.scenario_out.empty()) {
    SIXPOINT_CHECK(write_file(files, options.scenario_out, answer.scenario.dump(2) + "\n"));
  }
  return {};
}

Status run_gap(const GapCommandOptions& options, Context& context) {
  if (options.bundle.empty() && options.run.empty()) {
    return fail(ErrorCode::usage, "BUNDLE or --run is required", {}, "name one of them");
  }
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(take_outputs(options, outputs));
  SIXPOINT_ASSIGN(const Judged answer, diagnose(options, context));
  context.worsen(exit_code_of(answer.diagnosis));
  SIXPOINT_CHECK(write_reports(options, answer, outputs.files()));
  if (!options.json) {
    print_gap(answer.diagnosis, !options.run.empty(), context);
    return {};
  }
  Json json = document("gap-diagnose");
  json.update(answer.diagnosis.to_json());
  json["augmented_scenario"] = answer.scenario;
  return print_json(context, json);
}

}  // namespace

void add_gap(CLI::App& app, Context& context) {
  CLI::App& group = add_group(app, "gap", "simulator and recording: where they differ, and why");
  auto [diagnosis, options] = add_command<GapCommandOptions>(
      group, context, "gap-diagnose", "diagnose",
      "which effect explains a recording of a known protocol", run_gap);
  CLI::Option* bundle = diagnosis.add_option(
      "BUNDLE", options.bundle,
      "folder with recording.gt3x and protocol.json, a plain recording, or a table of readings "
      "(.txt, .csv, also .gz: time in seconds and three axes)");
  diagnosis
      .add_option("--rate", options.rate_hz, "readings a second of a table without a time column")
      ->check(CLI::Range(5.0, 10'000.0));
  diagnosis.add_option("--run", options.run, "a stored jig run instead of a bundle")
      ->excludes(bundle);
  add_store_option(diagnosis, options.store);
  diagnosis.add_option(
      "--population", options.population,
      "a scenario of `gap adopt`: what units like this one have is expected of it");
  diagnosis.add_option("--without", options.without, "effects taken out of the catalogue")
      ->delimiter(',');
  diagnosis
      .add_option("--matters-mg", options.matters_mg,
                  "an effect matters from this root mean square on (probability_it_matters)")
      ->check(CLI::Range(0.0, 1000.0));
  diagnosis.add_option("--html", options.html, "write the report as one page to this file");
  diagnosis.add_option("--png", options.png, "write the report as one sheet, PNG");
  diagnosis.add_option("--pdf", options.pdf, "write the report as one sheet, PDF");
  diagnosis.add_option("--seed", options.seed, "seed of the augmented scenario");
  diagnosis.add_option("--scenario-out", options.scenario_out,
                       "write the augmented scenario to this file");
  refuse_old_output(diagnosis, "--scenario", "--scenario-out");
  add_output_options(diagnosis, options.outputs);
  add_gap_challenge(group, context);
  add_gap_score(group, context);
  add_gap_answers(group, context);
  add_gap_trends(group, context);
  add_gap_adopt(group, context);
  add_gap_report(group, context);
}

}  // namespace sixpoint::cli
