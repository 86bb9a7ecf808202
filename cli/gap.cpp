// sixpoint gap diagnose BUNDLE: where simulator and recording part, and which effect explains it.
#include <chrono>
#include <memory>
#include <set>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "gap/bundle.h"
#include "gap/diagnose.h"
#include "gap/plain.h"
#include "gap/readings_table.h"
#include "gap/report_html.h"
#include "gap/report_sheet.h"
#include "station/cli/command.h"
#include "station/cli/gap_challenge.h"
#include "station/cli/gap_trends.h"
#include "station/cli/store_option.h"
#include "station/jig_bundle.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string bundle;
  std::string run;
  std::string store;
  std::vector<std::string> without;
  std::string html;
  std::string png;
  std::string pdf;
  std::string scenario;
  std::uint64_t seed = 0;
  double rate_hz = 0;  // 0: not told
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

Result<gap::Diagnosis> diagnose(const Options& options, Context& context) {
  const auto start = context.env.clock.elapsed();
  gap::DiagnoseOptions how;
  how.without = std::set<std::string>(options.without.begin(), options.without.end());
  how.seed = options.seed;
  if (!options.run.empty()) {
    SIXPOINT_ASSIGN(db::Store store, open_existing_store(context, options.store));
    SIXPOINT_ASSIGN(const station::StoredRun run, station::stored_run(store, options.run));
    SIXPOINT_ASSIGN(const std::string samples, station::samples_of_run(store, run.id));
    SIXPOINT_ASSIGN(const gap::Bundle bundle, station::bundle_of_run(run, samples));
    how.uncalibrated = true;
    SIXPOINT_ASSIGN(gap::Diagnosis diagnosis, gap::diagnose(bundle, how));
    diagnosis.seconds = std::chrono::duration<double>(context.env.clock.elapsed() - start).count();
    return diagnosis;
  }
  SIXPOINT_ASSIGN(const FileInfo info, context.env.files.info(options.bundle));
  if (!info.is_folder) {
    gap::ReadingsTableOptions table;
    table.rate_hz = options.rate_hz;
    SIXPOINT_ASSIGN(gap::Diagnosis plain,
                    gap::is_readings_table(options.bundle)
                        ? gap::diagnose_table(context.env.files, options.bundle, how, table)
                        : gap::diagnose_plain(context.env.files, options.bundle, how));
    plain.seconds = std::chrono::duration<double>(context.env.clock.elapsed() - start).count();
    return plain;
  }
  SIXPOINT_ASSIGN(const gap::Bundle bundle, gap::read_bundle(context.env.files, options.bundle));
  SIXPOINT_ASSIGN(gap::Diagnosis diagnosis, gap::diagnose(bundle, how));
  diagnosis.seconds = std::chrono::duration<double>(context.env.clock.elapsed() - start).count();
  return diagnosis;
}

void tell(const gap::Diagnosis& d, Context& context) {
  context.out << fmt::format("{}: {}\n", printable(d.bundle), printable(d.brief(), 2000));
  for (const gap::EffectFinding& effect : d.effects) {
    context.out << fmt::format("  {:<20} p {:.3f}  held out {:+.1f} nats", effect.name,
                               effect.probability, effect.held_out_gain_nats);
    for (const gap::NamedValue& p : effect.parameters) {
      context.out << fmt::format("  {} {:.4g}", p.name, fmt::join(p.value, " "));
    }
    context.out << (effect.outside_datasheet ? "  (outside the datasheet)\n" : "\n");
  }
  for (const std::string& where : d.unknown.where) {
    context.out << "  unknown: " << printable(where, 300) << '\n';
  }
  for (const gap::NextSegment& next : d.next_segments) {
    context.out << fmt::format("  next: {} ({:.0f} min) would show {}\n", next.name, next.minutes,
                               fmt::join(next.separates, ", "));
  }
  for (const std::string& loss : d.losses) {
    context.people << "sixpoint: " << printable(loss, 1000) << '\n';
  }
}

std::string_view as_text(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Status write_reports(const Options& options, const gap::Diagnosis& diagnosis, Context& context) {
  FileSystem& files = context.env.files;
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
  if (!options.scenario.empty()) {
    SIXPOINT_CHECK(
        write_file(files, options.scenario, gap::augmented_scenario(diagnosis).dump(2) + "\n"));
  }
  return {};
}

void run(const Options& options, Context& context) {
  const auto diagnosis = diagnose(options, context);
  if (!diagnosis) {
    return report_error(context, "gap-diagnose", diagnosis.error(), options.json);
  }
  context.worsen(exit_code_of(*diagnosis));
  if (const Status written = write_reports(options, *diagnosis, context); !written) {
    return report_error(context, "gap-diagnose", written.error(), options.json);
  }
  if (options.json) {
    Json json = document("gap-diagnose");
    json.update(diagnosis->to_json());
    print_json(context, json);
  } else {
    tell(*diagnosis, context);
  }
}

}  // namespace

void add_gap(CLI::App& app, Context& context) {
  auto* command =
      app.add_subcommand("gap", "simulator against recording: where they part, and why");
  command->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* diagnose_command =
      command->add_subcommand("diagnose", "which effect explains a recording of a known protocol");
  CLI::Option* bundle = diagnose_command->add_option(
      "BUNDLE", options->bundle,
      "folder with recording.gt3x and protocol.json, a plain recording, or a table of readings "
      "(.txt, .csv, also .gz: time in seconds and three axes)");
  diagnose_command
      ->add_option("--rate", options->rate_hz, "readings a second of a table without a time column")
      ->check(CLI::Range(5.0, 10'000.0));
  diagnose_command->add_option("--run", options->run, "a stored jig run instead of a bundle")
      ->excludes(bundle);
  add_store_option(*diagnose_command, options->store);
  diagnose_command->add_option("--without", options->without, "effects taken out of the catalogue")
      ->delimiter(',');
  diagnose_command->add_option("--html", options->html,
                               "write the report as one page to this file");
  diagnose_command->add_option("--png", options->png, "write the report as one sheet, PNG");
  diagnose_command->add_option("--pdf", options->pdf, "write the report as one sheet, PDF");
  diagnose_command->add_option("--seed", options->seed, "seed of the augmented scenario");
  diagnose_command->add_option("--scenario", options->scenario,
                               "write the augmented scenario to this file");
  diagnose_command->add_flag("--json", options->json, "one JSON document on standard output");
  diagnose_command->callback([options, &context] {
    if (options->bundle.empty() && options->run.empty()) {
      throw CLI::RequiredError("BUNDLE or --run");
    }
    run(*options, context);
  });
  add_gap_challenge(*command, context);
  add_gap_trends(*command, context);
}

}  // namespace sixpoint::cli
