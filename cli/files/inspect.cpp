// sixpoint inspect FILE: what a recording holds. It gives no verdict.
#include <functional>

#include <fmt/format.h>

#include "cli/command.h"
#include "gt3x/forms/model.h"
#include "repair/triage/inspection.h"
#include "repair/triage/survey.h"

namespace sixpoint::cli {
namespace {

Json axes(const PerAxis<int>& values) { return Json{values[0], values[1], values[2]}; }
Json axes(const PerAxis<double>& values) {
  return Json{number(values[0]), number(values[1]), number(values[2])};
}
std::string filter_name(std::optional<calib::FilterConfiguration> filter) {
  return std::string(filter ? calib::to_string(*filter) : "unknown");
}
std::string time_or_dash(std::optional<std::uint32_t> unix_time) {
  return unix_time ? to_iso8601(from_unix_seconds(*unix_time)) : "-";
}

Json time_or_null(std::optional<std::uint32_t> unix_time) {
  return unix_time ? Json(to_iso8601(from_unix_seconds(*unix_time))) : Json(nullptr);
}

Json to_json(const StoredConstants& constants) {
  return {{"positive_lsb", axes(constants.positive_lsb)},
          {"negative_lsb", axes(constants.negative_lsb)},
          {"zero_lsb", axes(constants.zero_lsb)}};
}

Json to_json(const repair::InspectedStill& still) {
  const bool any = still.magnitude.blocks > 0;
  return {{"blocks", still.magnitude.blocks},
          {"coverage_g",
           {{"min", any ? axes(still.coverage.min_g) : Json(nullptr)},
            {"max", any ? axes(still.coverage.max_g) : Json(nullptr)}}},
          {"magnitude_mg",
           {{"mean_error", any ? number(still.magnitude.mean_mg) : Json(nullptr)},
            {"worst_error", any ? number(still.magnitude.worst_mg) : Json(nullptr)}}}};
}

Json damage_of(const gt3x::LogStatistics& log) {
  Json losses = Json::array();
  for (const gt3x::Loss& loss : log.losses) {
    losses.push_back({{"offset", loss.offset},
                      {"bytes", loss.bytes},
                      {"after", time_or_null(loss.time_before)},
                      {"before", time_or_null(loss.time_after)}});
  }
  return {{"stretches", log.damaged_stretches},
          {"bytes", log.damaged_bytes},
          {"stray_bytes", log.stray_bytes},
          {"losses", std::move(losses)}};
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

Json to_json(const repair::Inspection& found, const std::string& path) {
  Json json = document("inspect");
  json["path"] = path;
  json["form"] = found.form;
  json["serial"] = found.facts.serial;
  json["firmware"] = found.facts.firmware;
  json["model"] = gt3x::model_of(found.facts.serial);
  json["device_type"] = found.device_type;
  json["sample_rate_hz"] = found.rate_hz ? number(*found.rate_hz) : Json(nullptr);
  json["accel_scale_lsb_per_g"] =
      found.accel_scale_lsb_per_g ? number(*found.accel_scale_lsb_per_g) : Json(nullptr);
  json["start"] = time_or_null(found.start);
  json["samples"] = found.samples;
  json["duration_s"] = number(found.duration_s());
  Json& records = json["records"] = Json::object();
  for_each_record_type(found.log,
                       [&](const auto& name, std::uint64_t count) { records[name] = count; });
  json["constants"] = found.constants ? to_json(*found.constants) : Json(nullptr);
  json["calibration_time"] = value_or_null(found.facts.calibration_time);
  json["filter"] = {
      {"in_force", filter_name(repair::filter_in_force(found.facts))},
      {"constants_measured_under", filter_name(repair::filter_of_constants(found.facts))}};
  Json& gaps = json["gaps"] = Json::array();
  for (const repair::InspectedGap& gap : found.gaps) {
    gaps.push_back({{"start", time_or_null(gap.start)},
                    {"seconds", gap.seconds},
                    {"kind", gt3x::to_string(gap.kind)}});
  }
  json["gap_count"] = found.gap_count;
  json["gap_seconds"] = found.gap_seconds;
  json["clipped_samples"] = found.clipped_samples;
  json["checksum_failures"] = found.log.checksum_failures;
  json["still"] = found.still ? to_json(*found.still) : Json(nullptr);
  json["damage"] = damage_of(found.log);
  json["already_repaired"] = found.already_repaired;
  Json& entries = json["entries"] = Json::array();
  for (const gt3x::EntryInfo& entry : found.entries) {
    entries.push_back({{"name", entry.name}, {"bytes", entry.size}});
  }
  json["warnings"] = found.warnings;
  if (found.problem) {
    json["error"] = error_to_json(*found.problem);
  }
  return json;
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

void print(std::ostream& out, const repair::Inspection& found, const std::string& path) {
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
    line("start", time_or_dash(found.start));
    line("duration",
         fmt::format("{:.1f} s, of which {} s are gaps", found.duration_s(), found.gap_seconds));
  }
  line("calibrated", found.facts.calibration_time ? to_iso8601(*found.facts.calibration_time)
                                                  : std::string("not said"));
  line("filter", fmt::format("{} in force, constants measured under {}",
                             filter_name(repair::filter_in_force(found.facts)),
                             filter_name(repair::filter_of_constants(found.facts))));
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
  constexpr std::size_t kGapsShown = 20;
  for (std::size_t i = 0; i < std::min(found.gaps.size(), kGapsShown); ++i) {
    const repair::InspectedGap& gap = found.gaps[i];
    line("gap", fmt::format("{}  {:>7} s  {}", to_iso8601(from_unix_seconds(gap.start)),
                            gap.seconds, gt3x::to_string(gap.kind)));
  }
  if (found.gap_count > kGapsShown) {
    line("gap", fmt::format("... {} in all; --json lists them", found.gap_count));
  }
}

struct Options {
  std::string path;
  bool json = false;
};

Status run(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(const repair::Inspection found, repair::inspect(context.env.files, options.path));
  if (options.json) {
    print_json(context, to_json(found, options.path));
  } else {
    print(context.out, found, options.path);
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
  auto [command, options] =
      add_command<Options>(app, context, "inspect", "what a .gt3x, .agdc or .agd file holds", run);
  command.add_option("FILE", options.path, "the recording")->required();
}

}  // namespace sixpoint::cli
