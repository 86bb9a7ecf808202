// sixpoint export PATH... --csv OUT | -o OUTDIR: the samples as the vendor's raw CSV; or what else
// was recorded.
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "gt3x/container/gzip_writer.h"
#include "gt3x/forms/small_records.h"
#include "gt3x/imu_csv.h"
#include "gt3x/records_csv.h"
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
  bool imu = false;
  std::string records;
  bool gzip = false;
  unsigned jobs = 0;
  OutputOptions outputs;
};

// What a kind of export says when it is done.
struct Done {
  std::string said;
  std::vector<std::string> warnings;
};

gt3x::RawCsvOptions::Time time_of(const Options& options) {
  using Time = gt3x::RawCsvOptions::Time;
  if (options.unix_time) {
    return Time::unix_seconds;
  }
  return options.time.empty() ? Time::none : options.time == "iso" ? Time::iso : Time::seconds;
}

Result<Done> export_samples(gt3x::Recording& recording, const Options& options,
                            const gt3x::TextSink& sink) {
  gt3x::RawCsvOptions how;
  how.raw_lsb = options.raw;
  how.fill = !options.no_fill;
  how.time = time_of(options);
  SIXPOINT_ASSIGN(const bool repaired, repair::carries_repair_mark(recording));
  if (repaired) {
    how.created_by = station::software_name() + " from a repaired recording";
  }
  SIXPOINT_ASSIGN(const gt3x::RawCsvTally tally, gt3x::write_raw_csv(recording, how, sink));
  Done done{fmt::format("{} samples, {} lines filled in", tally.samples, tally.filled), {}};
  if (tally.checksum_failures + tally.damaged_stretches > 0) {
    done.warnings.push_back(
        fmt::format("{} records with a wrong checksum and {} damaged stretches were left out",
                    tally.checksum_failures, tally.damaged_stretches));
  }
  if (tally.out_of_step_seconds > 0 && !options.no_fill) {
    done.warnings.push_back(
        fmt::format("at {} seconds the time does not go forward or there are too many samples: "
                    "after them the line number does not give the time",
                    tally.out_of_step_seconds));
  }
  return done;
}

Result<Done> export_imu(gt3x::Recording& recording, const gt3x::TextSink& sink) {
  SIXPOINT_ASSIGN(const gt3x::ImuCsvTally tally, gt3x::write_imu_csv(recording, sink));
  Done done{fmt::format("{} samples in {} seconds, {} seconds interpolated to {} Hz", tally.samples,
                        tally.seconds, tally.resampled_seconds, gt3x::kImuRate_hz),
            {}};
  if (tally.unreadable_records > 0) {
    done.warnings.push_back(fmt::format("{} records of the sensor cannot be read and were left out",
                                        tally.unreadable_records));
  }
  return done;
}

Result<Done> export_records(gt3x::Recording& recording, const std::string& name,
                            const gt3x::TextSink& sink) {
  SIXPOINT_ASSIGN(const std::uint8_t type, gt3x::parse_record_type(name));
  SIXPOINT_ASSIGN(const auto tally, gt3x::write_records_csv(recording, type, sink));
  Done done{fmt::format("{} records", tally.records), {}};
  if (tally.unreadable_records > 0) {
    done.warnings.push_back(
        fmt::format("{} records cannot be read and were left out", tally.unreadable_records));
  }
  return done;
}

Result<Done> export_recording(gt3x::Recording& recording, const Options& options,
                              const gt3x::TextSink& sink) {
  if (options.imu) {
    return export_imu(recording, sink);
  }
  return options.records.empty() ? export_samples(recording, options, sink)
                                 : export_records(recording, options.records, sink);
}

Status export_file(const Options& options, Context& context, FileSystem& files,
                   const std::string& path, const std::string& csv) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, path));
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, csv));
  gt3x::GzipWriter gzip([&](std::span<const std::uint8_t> bytes) { return out.append(bytes); },
                        threads_of(options.jobs));
  const auto sink = [&](std::string_view text) {
    return options.gzip ? gzip.append(text) : out.append(text);
  };
  SIXPOINT_ASSIGN(const Done done, export_recording(recording, options, sink));
  if (options.gzip) {
    SIXPOINT_CHECK(gzip.finish());
  }
  SIXPOINT_CHECK(out.commit());
  if (!context.out_is_taken) {
    context.people << fmt::format("{}: {}\n", printable(csv), done.said);
  }
  for (const std::string& warning : done.warnings) {
    context.log().warn("{}: {}", printable(path), warning);
  }
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
  auto* raw = command.add_flag("--raw", options.raw, "stored counts in LSB instead of g");
  auto* no_fill = command.add_flag("--no-fill", options.no_fill,
                                   "what was recorded, without the seconds that are missing");
  // Alone: iso.
  auto* time = command.add_flag("--time{iso}", options.time,
                                "a column of times, the file's clock: 2015-04-09T14:04:00.033; "
                                "--time=seconds: seconds since the first sample");
  time->check(CLI::IsMember({"iso", "seconds"}));
  auto* unix_time =
      command.add_flag("--unix", options.unix_time, "a column of times: seconds since 1970");
  unix_time->excludes(time);
  auto* imu = command.add_flag("--imu", options.imu,
                               "the inertial sensor of a GT9X Link instead: 100 lines per second");
  auto* records = command.add_option(
      "--records", options.records,
      "the records of one type instead: BATTERY, LUX, CAPSENSE, TEMPERATURE ...");
  imu->excludes(raw, no_fill, time, unix_time, records);
  records->excludes(raw, no_fill, time, unix_time);
  command.add_flag("--gzip", options.gzip, "write .csv.gz");
  command.add_option("--jobs", options.jobs, "threads that pack with --gzip (default: all cores)");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
