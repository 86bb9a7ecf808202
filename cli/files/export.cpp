// sixpoint export PATH... --csv OUT | -o OUTDIR: the samples as the vendor's raw CSV or as a NumPy
// array; or what else was recorded.
#include <algorithm>
#include <cstdlib>
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/files/salvage_option.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "gt3x/container/gzip_writer.h"
#include "gt3x/forms/small_records.h"
#include "gt3x/rows/imu_csv.h"
#include "gt3x/rows/records_csv.h"
#include "gt3x/rows/samples_npy.h"
#include "gt3x/salvage_losses.h"
#include "repair/triage/survey.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

// That may be asked for; a line of CSV is 20 bytes.
constexpr std::int64_t kLongestFill_s = std::int64_t{400} * 86'400;

struct ExportCommandOptions {
  std::vector<std::string> paths;
  std::string csv;
  std::string folder;
  std::string format = "csv";
  bool raw = false;
  bool no_fill = false;
  std::optional<std::uint64_t> fill_limit_s;
  std::string time;
  bool unix_time = false;
  bool imu = false;
  std::string records;
  bool gzip = false;
  bool salvage = false;
  unsigned jobs = 0;
  OutputOptions outputs;
};

// What a kind of export says when it is done.
struct Done {
  std::string said;
  std::vector<std::string> warnings;
};

gt3x::RawCsvOptions::Time time_of(const ExportCommandOptions& options) {
  using Time = gt3x::RawCsvOptions::Time;
  if (options.unix_time) {
    return Time::unix_seconds;
  }
  return options.time.empty() ? Time::none : options.time == "iso" ? Time::iso : Time::seconds;
}

void add_time_warnings(const gt3x::RawCsvTally& tally, std::vector<std::string>& warnings) {
  const auto clock = [](std::uint32_t unix_time) {
    return to_iso8601(from_unix_seconds(unix_time)).substr(0, 19);  // the file's own
  };
  const auto counted = [&](gt3x::IrregularKind kind, const char* what) {
    const auto& places = tally.irregular.places;
    const auto first = std::ranges::find(places, kind, &gt3x::Irregular::Place::kind);
    if (first != places.end()) {
      warnings.push_back(fmt::format("{} {}, the first of {}", tally.irregular.count(kind), what,
                                     clock(first->unix_time)));
    }
  };
  counted(gt3x::IrregularKind::repeated,
          "records repeat a second: each second is written once (--no-fill has them all)");
  counted(gt3x::IrregularKind::repeated_otherwise,
          "records repeat a second with other samples: the longer or first one is written");
  counted(gt3x::IrregularKind::out_of_order, "records came late: they are put in their place");
  counted(gt3x::IrregularKind::late, "records came too late and are left out (--no-fill has them)");
  if (tally.surplus_samples > 0) {
    warnings.push_back(
        fmt::format("{} samples beyond the rate of their second are left out (--no-fill has them)",
                    tally.surplus_samples));
  }
  for (const gt3x::RawCsvTally::Leap& leap : tally.leaps) {
    constexpr std::size_t kMostSaid = 20;
    if (warnings.size() >= kMostSaid) {
      warnings.push_back(fmt::format("{} such leaps in all", tally.leap_count));
      break;
    }
    warnings.push_back(fmt::format(
        "the time leaps {} {} s to {}: nothing is filled in, and behind it a line's number does "
        "not tell its time (--time does{})",
        leap.seconds < 0 ? "back by" : "forward over", std::abs(leap.seconds),
        clock(leap.unix_time),
        leap.seconds < 0                ? ""
        : !leap.missing                 ? "; what lies between stands further up"
        : leap.seconds > kLongestFill_s ? ""
                                        : fmt::format("; --fill-limit {} fills it", leap.seconds)));
  }
}

Result<Done> export_samples(gt3x::Recording& recording, const ExportCommandOptions& options,
                            const gt3x::TextSink& sink) {
  gt3x::RawCsvOptions how;
  how.raw_lsb = options.raw;
  how.fill = !options.no_fill;
  how.fill_limit_s = options.fill_limit_s.value_or(how.fill_limit_s);
  how.time = time_of(options);
  SIXPOINT_ASSIGN(const bool repaired, repair::carries_repair_mark(recording));
  if (repaired) {
    how.created_by = station::software_name() + " from a repaired recording";
  }
  const auto written = options.format == "npy" ? gt3x::write_samples_npy(recording, how, sink)
                                               : gt3x::write_raw_csv(recording, how, sink);
  SIXPOINT_ASSIGN(const gt3x::RawCsvTally tally, written);
  Done done{fmt::format("{} samples, {} lines filled in", tally.samples, tally.filled), {}};
  if (tally.checksum_failures + tally.damaged_stretches > 0) {
    done.warnings.push_back(
        fmt::format("{} records with a wrong checksum and {} damaged stretches were left out",
                    tally.checksum_failures, tally.damaged_stretches));
  }
  add_time_warnings(tally, done.warnings);
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
  if (tally.other_columns > 0) {
    done.warnings.push_back(
        fmt::format("{} seconds of the sensor have other columns than the first and were left out",
                    tally.other_columns));
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

Result<Done> export_kind(gt3x::Recording& recording, const ExportCommandOptions& options,
                         const gt3x::TextSink& sink) {
  if (options.imu) {
    return export_imu(recording, sink);
  }
  return options.records.empty() ? export_samples(recording, options, sink)
                                 : export_records(recording, options.records, sink);
}

Result<Done> export_recording(gt3x::Recording& recording, const ExportCommandOptions& options,
                              const gt3x::TextSink& sink) {
  SIXPOINT_ASSIGN(Done done, export_kind(recording, options, sink));
  if (options.salvage) {
    SIXPOINT_ASSIGN(const auto losses, gt3x::salvage_losses(recording));
    for (const gt3x::SalvageLoss& loss : losses) {
      done.warnings.push_back(loss.brief());
    }
  }
  return done;
}

Status export_file(const ExportCommandOptions& options, Context& context, FileSystem& files,
                   const std::string& path, const std::string& csv) {
  SIXPOINT_ASSIGN(auto recording,
                  gt3x::Recording::open(context.env.files, path, {options.salvage, {}}));
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

// "a/day1.gt3x" -> "a/day1.csv", "a/day1.npy.gz"
std::string export_name(const std::string& recording, const ExportCommandOptions& options) {
  return recording.substr(0, recording.rfind('.')) + "." + options.format +
         (options.gzip ? ".gz" : "");
}

// A file that fails does not stop the others.
Status export_into_folder(const ExportCommandOptions& options, Outputs& outputs, Context& context) {
  const auto named = named_files(context, options.paths, {".gt3x", ".agdc"});
  for (const NamedFile& file : named) {
    if (!file.error) {
      SIXPOINT_CHECK(outputs.input(file.path));
    }
  }
  SIXPOINT_CHECK(outputs.folder("--output", options.folder));
  std::set<std::string> taken;
  for (const NamedFile& file : named) {
    const std::string csv = options.folder + "/" + export_name(file.relative, options);
    const Status done = [&]() -> Status {
      if (file.error) {
        return fail(*file.error);
      }
      if (!taken.insert(csv).second) {
        return fail(ErrorCode::cannot_create, "another recording has the same name", file.path,
                    "export the two into separate folders");
      }
      SIXPOINT_CHECK(make_synced_folders(outputs.files(), folder_of(csv)));
      return export_file(options, context, outputs.files(), file.path, csv);
    }();
    if (!done) {
      report_error(context, done.error());
    }
  }
  return {};
}

Status run_export(const ExportCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, /*json=*/false);
  if (options.csv.empty() == options.folder.empty()) {
    return fail(ErrorCode::usage, "export writes one file (--csv) or a folder of them (--output)",
                {}, "name one of the two");
  }
  if (options.format == "npy" &&
      (!options.time.empty() || options.unix_time || options.imu || !options.records.empty())) {
    return fail(ErrorCode::usage, "a NumPy array holds samples alone", "--format npy",
                "leave out --time, --unix, --imu and --records, or write a CSV");
  }
  if (!options.folder.empty()) {
    return export_into_folder(options, outputs, context);
  }
  if (options.paths.size() > 1) {
    return fail(ErrorCode::usage, "one file holds one recording", options.paths[1],
                "name a folder with --output");
  }
  SIXPOINT_CHECK(outputs.input(options.paths.front()));
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  return export_file(options, context, outputs.files(), options.paths.front(), options.csv);
}

}  // namespace

void add_export(CLI::App& app, Context& context) {
  auto [command, options] = add_command<ExportCommandOptions>(
      app, context, "export", "the samples of recordings as the vendor's raw CSV writes them",
      run_export);
  command.add_option("path", options.paths, "recordings (.gt3x, .agdc) or folders of them")
      ->required();
  command.add_option("--csv", options.csv, "the file of one recording, - for standard output");
  command.add_option("-o,--output", options.folder, "a folder: NAME.csv for each recording");
  command
      .add_option(
          "--format", options.format,
          "csv (default), or npy: a NumPy array of X Y Z, float32 in g, or int16 with --raw")
      ->check(CLI::IsMember({"csv", "npy"}));
  auto* raw = command.add_flag("--raw", options.raw, "stored counts in LSB instead of g");
  auto* no_fill = command.add_flag("--no-fill", options.no_fill,
                                   "what was recorded, without the seconds that are missing");
  auto* fill_limit =
      command
          .add_option("--fill-limit", options.fill_limit_s,
                      "seconds that may be missing for no known reason and are still filled "
                      "(default: 3600)")
          ->check(CLI::Range(std::int64_t{0}, kLongestFill_s))
          ->type_name("SECONDS");
  fill_limit->excludes(no_fill);
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
  imu->excludes(raw, no_fill, fill_limit, time, unix_time, records);
  records->excludes(raw, no_fill, fill_limit, time, unix_time);
  command.add_flag("--gzip", options.gzip, "write .csv.gz, .npy.gz");
  add_salvage_option(command, options.salvage);
  add_jobs_option(command, options.jobs, "threads that pack with --gzip (default: all cores)");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
