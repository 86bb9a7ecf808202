// sixpoint export PATH... --csv OUT | -o OUTDIR: the samples as the vendor's raw CSV.
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "gt3x/container/gzip_writer.h"
#include "gt3x/raw_csv.h"
#include "repair/triage/survey.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::vector<std::string> paths;
  std::string csv;
  std::string folder;
  bool raw = false;
  bool no_fill = false;
  std::string time;
  bool unix_time = false;
  bool gzip = false;
  unsigned jobs = 0;
  OutputOptions outputs;
};

gt3x::RawCsvOptions::Time time_of(const Options& options) {
  using Time = gt3x::RawCsvOptions::Time;
  if (options.unix_time) {
    return Time::unix_seconds;
  }
  return options.time.empty() ? Time::none : options.time == "iso" ? Time::iso : Time::seconds;
}

void warn(const Options& options, Context& context, const std::string& path,
          const gt3x::RawCsvTally& tally) {
  const auto say = [&](const std::string& text) {
    context.log().warn("{}: {}", printable(path), text);
  };
  if (tally.checksum_failures + tally.damaged_stretches > 0) {
    say(fmt::format("{} records with a wrong checksum and {} damaged stretches were left out",
                    tally.checksum_failures, tally.damaged_stretches));
  }
  if (tally.out_of_step_seconds > 0 && !options.no_fill) {
    say(
        fmt::format("at {} seconds the time does not go forward or there are too many samples: "
                    "after them the line number does not give the time",
                    tally.out_of_step_seconds));
  }
}

Status export_file(const Options& options, Context& context, FileSystem& files,
                   const std::string& path, const std::string& csv) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, path));
  gt3x::RawCsvOptions how;
  how.raw_lsb = options.raw;
  how.fill = !options.no_fill;
  how.time = time_of(options);
  SIXPOINT_ASSIGN(const bool repaired, repair::carries_repair_mark(recording));
  if (repaired) {
    how.created_by = station::software_name() + " from a repaired recording";
  }
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, csv));
  gt3x::GzipWriter gzip([&](std::span<const std::uint8_t> bytes) { return out.append(bytes); },
                        threads_of(options.jobs));
  SIXPOINT_ASSIGN(const gt3x::RawCsvTally tally,
                  gt3x::write_raw_csv(recording, how, [&](std::string_view text) {
                    return options.gzip ? gzip.append(text) : out.append(text);
                  }));
  if (options.gzip) {
    SIXPOINT_CHECK(gzip.finish());
  }
  SIXPOINT_CHECK(out.commit());
  if (!context.out_is_taken) {
    context.people << fmt::format("{}: {} samples, {} lines filled in\n", printable(csv),
                                  tally.samples, tally.filled);
  }
  warn(options, context, path, tally);
  return {};
}

// "a/day1.gt3x" -> "a/day1.csv"
std::string csv_name(const std::string& recording, bool gzip) {
  return recording.substr(0, recording.rfind('.')) + (gzip ? ".csv.gz" : ".csv");
}

// A file that fails does not stop the others.
Status export_into_folder(const Options& options, Outputs& outputs, Context& context) {
  const auto named = named_files(context, options.paths, {".gt3x", ".agdc"});
  for (const NamedFile& file : named) {
    if (!file.error) {
      SIXPOINT_CHECK(outputs.input(file.path));
    }
  }
  SIXPOINT_CHECK(outputs.folder("--output", options.folder));
  std::set<std::string> taken;
  for (const NamedFile& file : named) {
    const std::string csv = options.folder + "/" + csv_name(file.relative, options.gzip);
    const Status done = [&]() -> Status {
      if (file.error) {
        return fail(*file.error);
      }
      if (!taken.insert(csv).second) {
        return fail(ErrorCode::cannot_create, "another recording has the same name", file.path,
                    "export the two into separate folders");
      }
      SIXPOINT_CHECK(outputs.files().make_folders(folder_of(csv)));
      return export_file(options, context, outputs.files(), file.path, csv);
    }();
    if (!done) {
      report_error(context, done.error());
    }
  }
  return {};
}

Status run(const Options& options, Context& context) {
  Outputs outputs(context, options.outputs, /*json=*/false);
  if (options.csv.empty() == options.folder.empty()) {
    return fail(ErrorCode::usage, "export writes one CSV (--csv) or a folder of them (--output)",
                {}, "name one of the two");
  }
  if (!options.folder.empty()) {
    return export_into_folder(options, outputs, context);
  }
  if (options.paths.size() > 1) {
    return fail(ErrorCode::usage, "one CSV holds one recording", options.paths[1],
                "name a folder with --output");
  }
  SIXPOINT_CHECK(outputs.input(options.paths.front()));
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  return export_file(options, context, outputs.files(), options.paths.front(), options.csv);
}

}  // namespace

void add_export(CLI::App& app, Context& context) {
  auto [command, options] = add_command<Options>(
      app, context, "export", "the samples of recordings as the vendor's raw CSV writes them", run);
  command.add_option("path", options.paths, "recordings (.gt3x, .agdc) or folders of them")
      ->required();
  command.add_option("--csv", options.csv, "the CSV of one recording, - for standard output");
  command.add_option("-o,--output", options.folder, "a folder: NAME.csv for each recording");
  command.add_flag("--raw", options.raw, "stored counts in LSB instead of g");
  command.add_flag("--no-fill", options.no_fill,
                   "what was recorded, without the seconds that are missing");
  auto* time = command.add_option("--time", options.time,
                                  "a column of times: iso (2015-04-09T14:04:00.033, the file's "
                                  "clock) or seconds since the first sample");
  time->check(CLI::IsMember({"iso", "seconds"}));
  command.add_flag("--unix", options.unix_time, "a column of times: seconds since 1970")
      ->excludes(time);
  command.add_flag("--gzip", options.gzip, "write .csv.gz");
  command.add_option("--jobs", options.jobs, "threads that pack with --gzip (default: all cores)");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
