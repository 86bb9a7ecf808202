// sixpoint inspect FILE: what a recording holds. It gives no verdict.
#include <functional>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/files/salvage_option.h"
#include "gt3x/forms/model.h"
#include "repair/batch/answers.h"
#include "repair/triage/inspection.h"
#include "repair/triage/survey.h"

namespace sixpoint::cli {
namespace {

// Times of a recording are said by its clock.
std::string time_or_dash(const gt3x::Clock& clock, std::optional<std::uint32_t> unix_time) {
  return unix_time ? gt3x::clock_time(clock, *unix_time) : "-";
}

// Calls visit(name, count) for every type of record in the log.
template <class Visit>
void for_each_record_type(const gt3x::LogStatistics& log, Visit visit) {
  for (std::size_t type = 0; type < log.records.size(); ++type) {
    if (log.records[type] > 0) {
      visit(gt3x::record_type_name(static_cast<std::uint8_t>(type)), log.records[type]);
    }
  }
}

using PrintLine = std::function<void(const char* name, const std::string& value)>;

void print_axes(std::ostream& out, const char* name, const PerAxis<int>& values) {
  out << fmt::format("  {:<18}{:>8}{:>8}{:>8}\n", name, values[0], values[1], values[2]);
}

void print_still(const repair::InspectedStill& still, const PrintLine& line) {
  line("still periods", fmt::format("{} of 4 s", still.magnitude.blocks));
  if (still.magnitude.blocks > 0) {
    line("  reach in g",
         fmt::format("X {:.2f} .. {:.2f}   Y {:.2f} .. {:.2f}   Z {:.2f} .. {:.2f}",
                     still.coverage.min_g[0], still.coverage.max_g[0], still.coverage.min_g[1],
                     still.coverage.max_g[1], still.coverage.min_g[2], still.coverage.max_g[2]));
    line("  from 1 g", fmt::format("{:.1f} mg on average, {:.1f} mg at worst",
                                   still.magnitude.mean_mg, still.magnitude.worst_mg));
  }
}

std::string clock_name(const gt3x::Clock& clock) {
  switch (clock.kind) {
    case gt3x::ClockKind::local:
      return "local time";
    case gt3x::ClockKind::utc:
      return "UTC";
    case gt3x::ClockKind::unknown:
      break;
  }
  return "not known";
}

void print_inspect(std::ostream& out, const repair::Inspection& found, const std::string& path) {
  const PrintLine line = [&](const char* name, const std::string& value) {
    out << fmt::format("{:<20}{}\n", name, printable(value, 200));
  };
  line("file", path);
  line("unit",
       fmt::format("{} ({}), firmware {}", found.facts.serial, gt3x::model_of(found.facts.serial),
                   found.facts.firmware.empty() ? "?" : found.facts.firmware));
  if (found.form != "agd") {
    line("samples", fmt::format("{} at {} Hz, {}", found.samples, found.rate_hz.value_or(0),
                                found.accel_scale_lsb_per_g
                                    ? fmt::format("{} LSB/g", *found.accel_scale_lsb_per_g)
                                    : std::string("raw counts")));
    line("clock", fmt::format("{}: {}", clock_name(found.clock), found.clock.why));
    line("start", time_or_dash(found.clock, found.start));
    if (found.first_after_start_s.value_or(0) != 0) {
      line("  after Start Date", fmt::format("{} s", *found.first_after_start_s));
    }
    line("duration",
         fmt::format("{:.1f} s, of which {} s are gaps", found.duration_s(), found.gap_seconds));
  }
  line("calibrated", found.facts.calibration_time ? to_iso8601(*found.facts.calibration_time)
                                                  : std::string("not said"));
  line("filter", fmt::format("{} in force, constants measured under {}",
                             repair::filter_name(repair::filter_in_force(found.facts)),
                             repair::filter_name(repair::filter_of_constants(found.facts))));
  if (found.constants) {
    out << fmt::format("{:<20}{:>8}{:>8}{:>8}\n", "constants in LSB", "X", "Y", "Z");
    print_axes(out, "positive", found.constants->positive_lsb);
    print_axes(out, "negative", found.constants->negative_lsb);
    print_axes(out, "zero", found.constants->zero_lsb);
  }
  if (found.still) {
    print_still(*found.still, line);
  }
  line("clipped samples", fmt::format("{}", found.clipped_samples));
  line("wrong checksums", fmt::format("{}", found.log.checksum_failures));
  for_each_record_type(found.log, [&](const auto& name, std::uint64_t count) {
    line("records", fmt::format("{:>9} {}", count, name));
  });
  for (const gt3x::SalvageLoss& loss : found.losses.value_or(std::vector<gt3x::SalvageLoss>())) {
    const std::string when = loss.from || loss.to
                                 ? fmt::format("{} .. {} ", time_or_dash(found.clock, loss.from),
                                               time_or_dash(found.clock, loss.to))
                                 : "";
    line("loss", fmt::format("{}{}: {}{}", when, gt3x::to_string(loss.kind),
                             loss.entry.empty() ? "" : loss.entry + ": ", loss.why));
  }
  constexpr std::size_t kGapsShown = 20;
  for (std::size_t i = 0; i < std::min(found.gaps.size(), kGapsShown); ++i) {
    const repair::InspectedGap& gap = found.gaps[i];
    line("gap", fmt::format("{}  {:>7} s  {}", gt3x::clock_time(found.clock, gap.start),
                            gap.seconds, gt3x::to_string(gap.kind)));
  }
  if (found.gap_count > kGapsShown) {
    line("gap", fmt::format("... {} in all; --json lists them", found.gap_count));
  }
}

struct InspectCommandOptions {
  std::string path;
  bool salvage = false;
  bool json = false;
};

Status run_inspect(const InspectCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const repair::Inspection found,
                  repair::inspect(context.env.files, options.path, {options.salvage, {}}));
  if (options.json) {
    Json json = document("inspect");
    json.update(repair::inspection_to_json(found, options.path));
    print_json(context, json);
  } else {
    print_inspect(context.out, found, options.path);
  }
  for (const std::string& warning : found.warnings) {
    context.log().warn("{}: {}", printable(options.path), warning);
  }
  if (found.problem) {
    report_error(context, *found.problem);
  }
  return {};
}

}  // namespace

void add_inspect(CLI::App& app, Context& context) {
  auto [command, options] = add_command<InspectCommandOptions>(
      app, context, "inspect", "what a .gt3x, .agdc or .agd file holds", run_inspect);
  command.add_option("FILE", options.path, "the recording")->required();
  add_salvage_option(command, options.salvage);
}

}  // namespace sixpoint::cli
