// sixpoint export FILE --csv OUT: the samples as the vendor's raw CSV.
#include <filesystem>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "gt3x/raw_csv.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string path;
  std::string csv;
  bool raw = false;
  bool no_fill = false;
};

// A wrong name must not destroy a recording: a file that begins like a zip is not written over.
Status refuse_recordings(FileSystem& files, const Options& options) {
  bool recording = std::filesystem::path(options.csv).lexically_normal() ==
                   std::filesystem::path(options.path).lexically_normal();
  if (const auto existing = files.open(options.csv)) {
    std::array<std::uint8_t, 2> start{};
    const auto count = (*existing)->read_at(0, start);
    recording = recording || (count && *count == 2 && start[0] == 'P' && start[1] == 'K');
  }
  if (recording) {
    return fail(ErrorCode::cannot_create, "this is a recording and is not written over",
                options.csv, "choose another name for the CSV");
  }
  return {};
}

Status run(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, options.path));
  const gt3x::RawCsvOptions how{options.raw, !options.no_fill};
  gt3x::RawCsvTally tally;
  if (options.csv == "-") {
    SIXPOINT_ASSIGN(tally,
                    gt3x::write_raw_csv(recording, how, [&](std::string_view text) -> Status {
                      context.out << text;
                      if (!context.out) {
                        return fail(ErrorCode::io, "standard output could not be written", {},
                                    "check the program that reads it");
                      }
                      return {};
                    }));
  } else {
    SIXPOINT_CHECK(refuse_recordings(context.env.files, options));
    SIXPOINT_ASSIGN(auto out, AtomicFile::create(context.env.files, options.csv));
    SIXPOINT_ASSIGN(tally,
                    gt3x::write_raw_csv(recording, how, [&](std::string_view text) -> Status {
                      return out.append(text);
                    }));
    SIXPOINT_CHECK(out.commit());
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
}

}  // namespace sixpoint::cli
