#include "repair/batch/answers.h"

#include <array>

#include "base/time.h"
#include "calib/constants.h"
#include "gt3x/forms/model.h"
#include "gt3x/log/record.h"

namespace sixpoint::repair {
namespace {

Json time_or_null(std::optional<UtcTime> time) {
  return time ? Json(to_iso8601(*time)) : Json(nullptr);
}
Json axes(const PerAxis<int>& values) { return Json{values[0], values[1], values[2]}; }
Json axes(const PerAxis<double>& values) {
  return Json{calib::number_or_null(values[0]), calib::number_or_null(values[1]),
              calib::number_or_null(values[2])};
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

Json to_json(const InspectedStill& still) {
  const bool any = still.magnitude.blocks > 0;
  return {
      {"blocks", still.magnitude.blocks},
      {"coverage_g",
       {{"min", any ? axes(still.coverage.min_g) : Json(nullptr)},
        {"max", any ? axes(still.coverage.max_g) : Json(nullptr)}}},
      {"magnitude_mg",
       {{"mean_error", any ? calib::number_or_null(still.magnitude.mean_mg) : Json(nullptr)},
        {"worst_error", any ? calib::number_or_null(still.magnitude.worst_mg) : Json(nullptr)}}}};
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
Json losses_of(const Inspection& found) {
  if (!found.losses) {
    return nullptr;
  }
  Json losses = losses_to_json(*found.losses);
  for (std::size_t i = 0; i < losses.size(); ++i) {
    losses[i]["from"] = time_or_null(found.clock, (*found.losses)[i].from);
    losses[i]["to"] = time_or_null(found.clock, (*found.losses)[i].to);
  }
  return losses;
}

}  // namespace

std::string filter_name(std::optional<calib::FilterConfiguration> filter) {
  return std::string(filter ? calib::to_string(*filter) : "unknown");
}

Json error_document(const Error& error) {
  return {{"code", to_string(error.code)},
          {"what", error.what},
          {"where", error.where},
          {"hint", error.hint}};
}

Json inspection_to_json(const Inspection& found, const std::string& path) {
  Json json;
  json["path"] = path;
  json["form"] = found.form;
  json["serial"] = found.facts.serial;
  json["firmware"] = found.facts.firmware;
  json["model"] = gt3x::model_of(found.facts.serial);
  json["device_type"] = found.device_type;
  json["sample_rate_hz"] = calib::number_or_null(found.rate_hz);
  json["accel_scale_lsb_per_g"] = calib::number_or_null(found.accel_scale_lsb_per_g);
  json["clock"] = to_json(found.clock);
  json["start"] = time_or_null(found.clock, found.start);
  json["first_after_start_s"] =
      found.first_after_start_s ? Json(*found.first_after_start_s) : Json(nullptr);
  json["samples"] = found.samples;
  json["duration_s"] = calib::number_or_null(found.duration_s());
  Json& records = json["records"] = Json::object();
  for (std::size_t type = 0; type < found.log.records.size(); ++type) {
    if (found.log.records[type] > 0) {
      records[gt3x::record_type_name(static_cast<std::uint8_t>(type))] = found.log.records[type];
    }
  }
  json["constants"] = found.constants ? to_json(*found.constants) : Json(nullptr);
  json["calibration_time"] = time_or_null(found.facts.calibration_time);
  json["filter"] = {{"in_force", filter_name(filter_in_force(found.facts))},
                    {"constants_measured_under", filter_name(filter_of_constants(found.facts))}};
  Json& gaps = json["gaps"] = Json::array();
  for (const InspectedGap& gap : found.gaps) {
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
    json["error"] = error_document(*found.problem);
  }
  return json;
}

Json scanned_to_json(const ScannedFile& answer) {
  Json json;
  json["path"] = answer.path;
  json["verdict"] = answer.verdict;
  json["reasons"] = answer.reasons;
  json["serial"] = answer.facts.serial;
  json["firmware"] = answer.facts.firmware;
  json["calibration_time"] = time_or_null(answer.facts.calibration_time);
  json["evidence_mg"] = calib::number_or_null(answer.evidence_mg);
  json["axes_rotated"] = answer.axes_rotated;
  json["sides"] = answer.sides;
  return json;
}

Json scan_summary(const std::vector<ScannedFile>& answers) {
  Json summary = {{"files", answers.size()}, {"affected", 0},   {"not_affected", 0},
                  {"cannot_tell", 0},        {"unreadable", 0}, {"axes_rotated", 0}};
  for (const ScannedFile& answer : answers) {
    summary[answer.verdict] = summary[answer.verdict].get<int>() + 1;
    summary["axes_rotated"] = summary["axes_rotated"].get<int>() + (answer.axes_rotated ? 1 : 0);
  }
  return summary;
}

RepairCounts count_by_status(const std::vector<RepairReport>& reports) {
  RepairCounts counts;
  for (const RepairReport& report : reports) {
    ++counts[report.status];
  }
  return counts;
}

Json repair_summary(RepairCounts counts, bool dry_run) {
  std::size_t files = 0;
  for (const auto& [status, count] : counts) {
    files += count;
  }
  Json summary = {{"files", files}};
  for (const RepairStatus status :
       {RepairStatus::repaired, RepairStatus::not_affected, RepairStatus::not_repairable,
        RepairStatus::already_repaired, RepairStatus::outdated, RepairStatus::failed}) {
    summary[std::string(to_string(status))] = counts[status];
  }
  summary["dry_run"] = dry_run;
  return summary;
}

}  // namespace sixpoint::repair
