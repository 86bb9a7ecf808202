// sixpoint inspect FILE: what a recording holds. It gives no verdict.
#include <functional>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/files/salvage_option.h"
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
// Times of a recording are said by its clock.
std::string time_or_dash(const gt3x::Clock& clock, std::optional<std::uint32_t> unix_time) {
  return unix_time ? gt3x::clock_time(clock, *unix_time) : "-";
}

Json time_or_null(const gt3x::Clock& clock, std::optional<std::uint32_t> unix_time) {
  return unix_time ? Json(gt3x::clock_time(clock, *unix_time)) : Json(nullptr);
}

Json to_json(const gt3x::Clock& clock) {
  return {{"kind", gt3x::to_string(clock.kind)},
          {"offset_minutes", clock.offset_minutes ? Json(*clock.offset_minutes) : Json(nullptr)},
          {"why", clock.why}};
}

Json to_json(const gt3x::Irregular& irregular, const gt3x::Clock& clock) {
  using enum gt3x::IrregularKind;
  Json places = Json::array();
  for (const gt3x::Irregular::Place& place : irregular.places) {
    Json one = {{"kind", gt3x::to_string(place.kind)},
                {"time", gt3x::clock_time(clock, place.unix_time)},
                {"offset", place.offset}};
    if (place.kind == odd_size) {
      one["samples"] = place.value;
    } else if (place.kind == jump) {
      one["seconds"] = place.value;
    }
    places.push_back(std::move(one));
  }
  return {{"repeated_seconds", irregular.repeated_seconds()},
          {"out_of_order", irregular.records_out_of_order()},
          {"odd_sized_seconds", irregular.count(odd_size)},
          {"jumps", irregular.count(jump)},
          {"usb_and_samples", irregular.count(usb_and_samples)},
          {"places", std::move(places)}};
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

Json damage_of(const gt3x::LogStatistics& log, const gt3x::Clock& clock) {
  Json losses = Json::array();
  for (const gt3x::Loss& loss : log.losses) {
    losses.push_back({{"offset", loss.offset},
                      {"bytes", loss.bytes},
                      {"after", time_or_null(clock, loss.time_before)},
                      {"before", time_or_null(clock, loss.time_after)}});
  }
  return {{"stretches", log.damaged_stretches},
          {"bytes", log.damaged_bytes},
          {"stray_bytes", log.stray_bytes},
          {"losses", std::move(losses)}};
}

// As in the answer of repair, but by the recording's clock, as the other times here.
Json losses_of(const repair::Inspection& found) {
  if (!found.losses) {
    return nullptr;
  }
  Json losses = repair::losses_to_json(*found.losses);
  for (std::size_t i = 0; i < losses.size(); ++i) {
    losses[i]["from"] = time_or_null(found.clock, (*found.losses)[i].from);
    losses[i]["to"] = time_or_null(found.clock, (*found.losses)[i].to);
  }
  return losses;
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
  json["clock"] = to_json(found.clock);
  json["start"] = time_or_null(found.clock, found.start);
  json["first_after_start_s"] =
      found.first_after_start_s ? Json(*found.first_after_start_s) : Json(nullptr);
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
    gaps.push_back({{"start", time_or_null(found.clock, gap.start)},
                    {"seconds", gap.seconds},
                    {"kind", gt3x::to_string(gap.kind)}});
  }
  json["gap_count"] = found.gap_count;
  json["gap_seconds"] = found.gap_seconds;
  json["irregular"] = to_json(found.irregular, found.clock);
  json["clipped_samples"] = found.clipped_samples;
  json["checksum_failures"] = found.log.checksum_failures;
  json["still"] = found.still ? to_json(*found.still) : Json(nullptr);
  json["damage"] = damage_of(found.log, found.clock);
  json["losses"] = losses_of(found);
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

struct Options {
  std::string path;
  bool salvage = false;
  bool json = false;
};

Status run(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(const repair::Inspection found,
                  repair::inspect(context.env.files, options.path, {options.salvage, {}}));
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
  add_salvage_option(command, options.salvage);
}

}  // namespace sixpoint::cli
