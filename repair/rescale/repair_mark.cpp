#include "repair/rescale/repair_mark.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "gt3x/recording.h"

namespace sixpoint::repair {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kLargestMark = 1U << 20;
constexpr std::size_t kLossesInRecord = 20;

}  // namespace

std::string mark_name(const RepairReport& report) {
  return report.method == kSalvageMethod ? kSalvageMark : kRepairMark;
}

Json still_error_to_json(const RepairReport& report) {
  return {{"before", calib::number_or_null(report.still_error_before_mg)},
          {"after", calib::number_or_null(report.still_error_after_mg)}};
}

Json sample_uncertainty_to_json(const RepairReport& report) {
  return report.sample_uncertainty_mg ? Json(*report.sample_uncertainty_mg) : Json(nullptr);
}

Json mark_of(const RepairReport& report, const std::optional<ChosenConstants>& chosen,
             const Survey& survey, const std::string& recipe, UtcTime now) {
  Json mark;
  mark["schema"] = "sixpoint/repair-mark/1";
  mark["repaired_at"] = to_iso8601(now);
  mark["input_sha256"] = report.input_sha256;
  mark["recipe"] = recipe;
  mark["serial"] = report.serial;
  mark["method"] = report.method;
  mark["rotation_undone"] = report.rotation_undone;
  mark["constants_before"] = Json::array();
  for (const StoredConstants& constants : survey.constants) {
    mark["constants_before"].push_back(calib::to_json(constants));
  }
  mark["constants_after"] = chosen ? calib::to_json(chosen->record) : Json(nullptr);
  mark["constants_id"] = report.constants_id.empty() ? Json(nullptr) : Json(report.constants_id);
  mark["source"] = report.source ? report.source->to_json() : Json(nullptr);
  mark["forced"] = report.forced;
  mark["cross_axis_applied"] = report.cross_axis_applied;
  mark["sample_uncertainty_mg"] = sample_uncertainty_to_json(report);
  mark["still_error_mg"] = still_error_to_json(report);
  if (report.forced) {
    mark["reasons"] = report.reasons;
  }
  if (!report.losses.empty()) {
    mark["losses"] = losses_to_json(report.losses);
  }
  return mark;
}

// The vendor's own METADATA records begin and end with the same members.
std::string mark_record_of(const RepairReport& report) {
  Json record = {
      {"MetadataType", report.method == kSalvageMethod ? kSalvageMarkType : kRepairMarkType},
      {"Schema", "sixpoint/repair-mark/1"},
      {"InputSha256", report.input_sha256},
      {"Serial", report.serial},
      {"Method", report.method},
      {"ConstantsId", report.constants_id},
      {"RotationUndone", report.rotation_undone},
      {"Forced", report.forced},
      {"CrossAxisApplied", report.cross_axis_applied},
      {"SampleUncertaintyMg", sample_uncertainty_to_json(report)},
      {"Parsed", false},
      {"JSON", nullptr}};
  if (!report.losses.empty()) {
    // A record has room for 64 KB; the entry lists them all.
    const std::size_t listed = std::min<std::size_t>(report.losses.size(), kLossesInRecord);
    record["Losses"] = losses_to_json(
        {report.losses.begin(), report.losses.begin() + static_cast<std::ptrdiff_t>(listed)});
    record["LossCount"] = report.losses.size();
  }
  return record.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<Json> mark_in(FileSystem& files, const std::string& path) {
  auto recording = gt3x::Recording::open(files, path);
  if (!recording) {
    return std::nullopt;
  }
  auto source =
      recording->open_entry(recording->has_entry(kRepairMark) ? kRepairMark : kSalvageMark);
  if (!source) {
    return std::nullopt;
  }
  const auto bytes = gt3x::read_all(**source, kLargestMark);
  if (!bytes) {
    return std::nullopt;
  }
  auto mark = parse_json(as_text(*bytes));
  return mark.is_object() ? std::optional(std::move(mark)) : std::nullopt;
}

std::string text_in(const Json& mark, const char* key) {
  return mark.contains(key) && mark[key].is_string() ? mark[key].get<std::string>() : "";
}

std::optional<PerAxis<double>> three_in(const Json& mark, const char* key) {
  const auto found = mark.find(key);
  const bool three = found != mark.end() && found->is_array() && found->size() == kAxes &&
                     std::ranges::all_of(*found, [](const Json& one) { return one.is_number(); });
  return three ? std::optional(found->get<PerAxis<double>>()) : std::nullopt;
}

}  // namespace sixpoint::repair
