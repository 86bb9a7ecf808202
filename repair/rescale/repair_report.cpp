#include "repair/rescale/repair_report.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "repair/rescale/repair_mark.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

// In the order of RepairStatus.
constexpr std::array<std::string_view, 6> kStatusNames = {
    "repaired", "not_affected", "not_repairable", "already_repaired", "outdated", "failed"};

}  // namespace

std::string_view to_string(RepairStatus status) {
  return kStatusNames[static_cast<std::size_t>(status)];
}

std::optional<RepairStatus> parse_repair_status(std::string_view text) {
  const auto found = std::ranges::find(kStatusNames, text);
  return found == kStatusNames.end()
             ? std::nullopt
             : std::optional(static_cast<RepairStatus>(found - kStatusNames.begin()));
}

std::string RepairReport::brief() const {
  std::string text = fmt::format("{:<16} {}", to_string(status), printable(input));
  if (still_error_before_mg && still_error_after_mg) {
    text += fmt::format("  still error {:.1f} -> {:.1f} mg", *still_error_before_mg,
                        *still_error_after_mg);
  }
  if (source) {
    text += fmt::format("  {} {}", status == RepairStatus::repaired ? "by" : "with",
                        printable(source->brief()));
  }
  return text;
}

Json RepairReport::to_json() const {
  const auto optional_text = [](const std::string& text) {
    return text.empty() ? Json(nullptr) : Json(text);
  };
  return {
      {"input", input},
      {"output", optional_text(output)},
      {"linked", optional_text(linked)},
      {"status", sixpoint::repair::to_string(status)},
      {"method", optional_text(method)},
      {"reasons", reasons},
      {"serial", serial},
      {"calibration_time", calibration_time ? Json(to_iso8601(*calibration_time)) : Json(nullptr)},
      {"samples", samples},
      {"clipped_before", clipped_before},
      {"clipped_after", clipped_after},
      {"still_blocks", still_blocks},
      {"verdict", optional_text(verdict)},
      {"sides", sides},
      {"still_error_mg", still_error_to_json(*this)},
      {"rotation_undone", rotation_undone},
      {"for_a_person", for_a_person},
      {"forced", forced},
      {"cross_axis_applied", cross_axis_applied},
      {"sample_uncertainty_mg", sample_uncertainty_to_json(*this)},
      {"source", source ? source->to_json() : Json(nullptr)},
      {"losses", losses_to_json(losses)},
      {"constants_id", optional_text(constants_id)},
      {"input_sha256", optional_text(input_sha256)},
      {"output_sha256", optional_text(output_sha256)}};
}

NextRun next_run(const Error& error, bool salvage) {
  if (error.hint == kAnotherFolder || error.hint == kFolderWithoutRecordings ||
      error.hint == kSeparateRuns) {
    return NextRun::none;
  }
  switch (error.code) {
    case ErrorCode::no_input:
    case ErrorCode::permission:
    case ErrorCode::io:
    case ErrorCode::cannot_create:
      return NextRun::same;
    case ErrorCode::bad_data:
      if (error.what == kChangedMeanwhile) {
        return NextRun::same;
      }
      return !salvage && error.hint.find("--salvage") != std::string::npos ? NextRun::with_salvage
                                                                           : NextRun::none;
    default:
      return NextRun::none;
  }
}

RepairReport failed_report(const std::string& input, const Error& error) {
  RepairReport report;
  report.input = input;
  report.error = error;
  report.reasons.push_back(error.brief());
  return report;
}

}  // namespace sixpoint::repair
