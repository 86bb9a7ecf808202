// sixpoint export FILE --csv OUT: the samples as the vendor's raw CSV; or what else it recorded.
#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "gt3x/forms/small_records.h"
#include "gt3x/imu_csv.h"
#include "gt3x/records_csv.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string path;
  std::string csv;
  bool raw = false;
  bool no_fill = false;
  bool imu = false;
  std::string records;
  OutputOptions outputs;
};

// What a kind of export says when it is done.
struct Done {
  std::string said;
  std::vector<std::string> warnings;
};

Result<Done> export_samples(gt3x::Recording& recording, const Options& options,
                            const gt3x::TextSink& sink) {
  const gt3x::RawCsvOptions how{options.raw, !options.no_fill};
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

Status run(const Options& options, Context& context) {
  Outputs outputs(context, options.outputs, /*json=*/false);
  SIXPOINT_CHECK(outputs.input(options.path));
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, options.path));
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(outputs.files(), options.csv));
  const gt3x::TextSink sink = [&](std::string_view text) { return out.append(text); };
  SIXPOINT_ASSIGN(const Done done, options.imu ? export_imu(recording, sink)
                                   : !options.records.empty()
                                       ? export_records(recording, options.records, sink)
                                       : export_samples(recording, options, sink));
  SIXPOINT_CHECK(out.commit());
  if (!context.out_is_taken) {
    context.people << fmt::format("{}: {}\n", printable(options.csv), done.said);
  }
  for (const std::string& warning : done.warnings) {
    context.log().warn("{}: {}", printable(options.path), warning);
  }
  return {};
}

}  // namespace

void add_export(CLI::App& app, Context& context) {
  auto [command, options] = add_command<Options>(
      app, context, "export", "a recording's samples as the vendor's raw CSV writes them", run);
  command.add_option("FILE", options.path, "the recording")->required();
  command.add_option("--csv", options.csv, "the CSV to write, - for standard output")->required();
  auto* raw = command.add_flag("--raw", options.raw, "stored counts in LSB instead of g");
  auto* no_fill = command.add_flag("--no-fill", options.no_fill,
                                   "what was recorded, without the seconds that are missing");
  auto* imu = command.add_flag("--imu", options.imu,
                               "the inertial sensor of a GT9X Link instead: 100 lines per second");
  auto* records = command.add_option(
      "--records", options.records,
      "the records of one type instead: BATTERY, LUX, CAPSENSE, TEMPERATURE ...");
  imu->excludes(raw, no_fill, records);
  records->excludes(raw, no_fill);
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
