#include "repair/units/unit_needs.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/text/counted.h"
#include "base/text/csv_field.h"
#include "repair/rescale/gate.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 6> kSides = {"+x", "-x", "+y", "-y", "+z", "-z"};
constexpr const char* kHowTo =
    "put the unit on the jig, or record a calibration file with it under firmware 1.4.0 to 1.7.0";

std::string serial_text(const std::string& serial) {
  return serial.empty() ? "(not said)" : printable(serial, 40);
}

}  // namespace

std::string what_would_help(const UnitNeeds& unit) {
  const std::string never = fmt::format("{} {} never up", fmt::join(unit.sides_missing, " "),
                                        unit.sides_missing.size() == 1 ? "was" : "were");
  if (unit.waiting > 0) {
    const std::string wait = fmt::format("{} {} for constants; ", counted(unit.waiting, "file"),
                                         unit.waiting == 1 ? "waits" : "wait");
    if (unit.contradiction) {
      return wait + "what is known of the unit contradicts itself: put the unit on the jig";
    }
    if (!unit.sides_missing.empty()) {
      return fmt::format("{}{}: {}", wait, never, kHowTo);
    }
    if (unit.own_asked) {
      return fmt::format("{}all sides were up, but the still periods do not suffice: {}", wait,
                         kHowTo);
    }
    return fmt::format(
        "{}all sides were up: --or-scan uses the unit's own still periods; where these do not "
        "suffice, {}",
        wait, kHowTo);
  }
  if (unit.refused > 0) {
    std::string text =
        fmt::format("{} not written with the constants that there are: read the reasons",
                    counted(unit.refused, "file"));
    if (unit.not_applied > 0) {
      text += "; " + what_may_help(unit.of_still_periods, unit.sides_covered.size());
    }
    if (unit.of_store) {
      text +=
          fmt::format("; 'sixpoint history {}' lists what the store holds: withdraw what is wrong",
                      printable(unit.serial, 40));
    }
    return text;
  }
  if (unit.scanned > 0) {
    return unit.sides_missing.empty()
               ? std::string("repair: all sides were up in its still periods")
               : fmt::format("repair; without constants from elsewhere {}", never);
  }
  return "";
}

UnitTable::UnitTable(const std::vector<SourceKind>& asked)
    : own_asked_(std::ranges::find(asked, SourceKind::scan) != asked.end()) {}

void UnitTable::add(const RepairReport& report) {
  Unit& unit = units_[report.serial];
  UnitNeeds& needs = unit.needs;
  needs.serial = report.serial;
  needs.own_asked = own_asked_;
  ++needs.files;
  if (report.status == RepairStatus::failed) {
    ++needs.failed;
    return;
  }
  if (report.verdict == to_string(Verdict::cannot_tell)) {
    ++needs.cannot_tell;
  }
  if (report.status == RepairStatus::already_repaired) {
    return;
  }
  if (report.verdict != to_string(Verdict::affected)) {
    return;
  }
  ++needs.affected;
  unit.sides.insert(report.sides.begin(), report.sides.end());
  if (report.status == RepairStatus::repaired) {
    ++needs.repaired;
  } else if (report.source || report.status == RepairStatus::outdated) {
    ++needs.refused;
    if (report.status != RepairStatus::outdated) {
      ++needs.not_applied;
      needs.of_still_periods = needs.of_still_periods || is_of_still_periods(report.source->kind);
      needs.of_store = needs.of_store || report.source->kind == to_string(SourceKind::store);
    }
  } else {
    ++needs.waiting;
    needs.contradiction = needs.contradiction || report.for_a_person;
  }
}

void UnitTable::add(const ScannedFile& file) {
  Unit& unit = units_[file.facts.serial];
  UnitNeeds& needs = unit.needs;
  needs.serial = file.facts.serial;
  ++needs.files;
  if (file.error) {
    ++needs.failed;
  } else if (file.verdict == to_string(Verdict::cannot_tell)) {
    ++needs.cannot_tell;
  } else if (file.verdict == to_string(Verdict::affected)) {
    ++needs.affected;
    ++needs.scanned;
    unit.sides.insert(file.sides.begin(), file.sides.end());
  }
}

void UnitTable::add(const std::string& serial, const UnitAnswer& answer) {
  Unit& unit = units_[serial];
  UnitNeeds& needs = unit.needs;
  needs.serial = serial;
  needs.own_asked = true;
  needs.affected += answer.files;
  const bool helped = answer.record || answer.own_suffices;
  (helped ? needs.scanned : needs.waiting) += answer.files;
  needs.contradiction = needs.contradiction || answer.row == UnitRow::contradiction;
  for (const char* side : kSides) {
    if (std::ranges::find(answer.missing_sides, side) == answer.missing_sides.end()) {
      unit.sides.insert(side);
    }
  }
}

std::vector<UnitNeeds> UnitTable::rows() const {
  std::vector<UnitNeeds> rows;
  for (const auto& [serial, unit] : units_) {
    UnitNeeds row = unit.needs;
    if (row.affected + row.cannot_tell + row.failed == 0) {
      continue;
    }
    for (const char* side : kSides) {
      (unit.sides.contains(side) ? row.sides_covered : row.sides_missing).emplace_back(side);
    }
    row.help = what_would_help(row);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string units_text(const std::vector<UnitNeeds>& rows, std::size_t limit) {
  std::string text =
      fmt::format("{:<16} {:>6} {:>8} {:>8} {:>8}  {:<17}  {}\n", "unit", "files", "affected",
                  "repaired", "waiting", "sides covered", "what would help");
  const std::size_t shown = limit == 0 ? rows.size() : std::min(limit, rows.size());
  for (std::size_t i = 0; i < shown; ++i) {
    const UnitNeeds& row = rows[i];
    text += fmt::format(
        "{:<16} {:>6} {:>8} {:>8} {:>8}  {:<17}  {}\n", serial_text(row.serial),
        row.files == 0 ? "-" : std::to_string(row.files), row.affected, row.repaired, row.waiting,
        fmt::format("{}", fmt::join(row.sides_covered, " ")), row.help.empty() ? "-" : row.help);
  }
  if (shown < rows.size()) {
    text += fmt::format("... and {} more\n", rows.size() - shown);
  }
  return text;
}

std::string units_csv(const std::vector<UnitNeeds>& rows) {
  std::string csv =
      "unit,files,affected,repaired,waiting,refused,scanned,cannot_tell,failed,sides_covered,"
      "sides_missing,help\r\n";
  for (const UnitNeeds& row : rows) {
    csv += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
                       csv_field(printable(row.serial, 100)), row.files, row.affected, row.repaired,
                       row.waiting, row.refused, row.scanned, row.cannot_tell, row.failed,
                       fmt::join(row.sides_covered, " "), fmt::join(row.sides_missing, " "),
                       csv_field(row.help));
  }
  return csv;
}

Json units_json(const std::vector<UnitNeeds>& rows) {
  Json list = Json::array();
  for (const UnitNeeds& row : rows) {
    list.push_back({{"serial", row.serial},
                    {"files", row.files == 0 ? Json(nullptr) : Json(row.files)},
                    {"affected", row.affected},
                    {"repaired", row.repaired},
                    {"waiting", row.waiting},
                    {"refused", row.refused},
                    {"scanned", row.scanned},
                    {"cannot_tell", row.cannot_tell},
                    {"failed", row.failed},
                    {"contradiction", row.contradiction},
                    {"sides_covered", row.sides_covered},
                    {"sides_missing", row.sides_missing},
                    {"help", row.help.empty() ? Json(nullptr) : Json(row.help)}});
  }
  return list;
}

}  // namespace sixpoint::repair
