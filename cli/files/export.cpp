// sixpoint export FILE --csv OUT: the samples as the vendor's raw CSV.
#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "gt3x/raw_csv.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string path;
  std::string csv;
  bool raw = false;
  bool no_fill = false;
  OutputOptions outputs;
};

Status run(const Options& options, Context& context) {
  Outputs outputs(context, options.outputs, /*json=*/false);
  SIXPOINT_CHECK(outputs.input(options.path));
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, options.path));
  const gt3x::RawCsvOptions how{options.raw, !options.no_fill};
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(outputs.files(), options.csv));
  SIXPOINT_ASSIGN(
      const gt3x::RawCsvTally tally,
      gt3x::write_raw_csv(recording, how, [&](std::string_view text) { return out.append(text); }));
  SIXPOINT_CHECK(out.commit());
  if (!context.out_is_taken) {
    context.people << fmt::format("{}: {} samples, {} lines filled in\n", printable(options.csv),
                                  tally.samples, tally.filled);
  }
  const auto warn = [&](const std::string& text) {
    context.log().warn("{}: {}", printable(options.path), text);
  };
  if (tally.checksum_failures + tally.damaged_stretches > 0) {
    warn(fmt::format("{} records with a wrong checksum and {} damaged stretches were left out",
                     tally.checksum_failures, tally.damaged_stretches));
  }
  if (tally.out_of_step_seconds > 0 && !options.no_fill) {
    warn(
        fmt::format("at {} seconds the time does not go forward or there are too many samples: "
                    "after them the line number does not give the time",
                    tally.out_of_step_seconds));
  }
  return {};
}

}  // namespace

void add_export(CLI::App& app, Context& context) {
  auto [command, options] = add_command<Options>(
      app, context, "export", "a recording's samples as the vendor's raw CSV writes them", run);
  command.add_option("FILE", options.path, "the recording")->required();
  command.add_option("--csv", options.csv, "the CSV to write, - for standard output")->required();
  command.add_flag("--raw", options.raw, "stored counts in LSB instead of g");
  command.add_flag("--no-fill", options.no_fill,
                   "what was recorded, without the seconds that are missing");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
