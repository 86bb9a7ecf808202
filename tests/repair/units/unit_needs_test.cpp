#include "repair/units/unit_needs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sixpoint::repair {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

RepairReport affected(RepairStatus status, std::vector<std::string> sides) {
  RepairReport report;
  report.serial = "MOS2A45130450";
  report.verdict = "affected";
  report.status = status;
  report.sides = std::move(sides);
  return report;
}

UnitNeeds only_row(const std::vector<RepairReport>& reports) {
  UnitTable table;
  for (const RepairReport& report : reports) {
    table.add(report);
  }
  const auto rows = table.rows();
  EXPECT_EQ(rows.size(), 1U);
  return rows.empty() ? UnitNeeds() : rows.front();
}

const std::vector<std::string> kAll = {"+x", "-x", "+y", "-y", "+z", "-z"};

TEST(UnitNeeds, ASideThatWasNeverUpIsNamed) {
  const UnitNeeds row = only_row({affected(RepairStatus::not_repairable, {"+x", "-x", "+y"}),
                                  affected(RepairStatus::not_repairable, {"-y", "+z"})});
  EXPECT_EQ(row.files, 2U);
  EXPECT_EQ(row.waiting, 2U);
  EXPECT_THAT(row.sides_missing, ElementsAre("-z"));
  EXPECT_THAT(row.sides_covered, ElementsAre("+x", "-x", "+y", "-y", "+z"));
  EXPECT_THAT(row.help, AllOf(HasSubstr("2 files wait for constants"), HasSubstr("-z was never up"),
                              HasSubstr("jig"), HasSubstr("calibration file")));
}

TEST(UnitNeeds, AllSidesUpAndStillNotEnough) {
  const UnitNeeds row = only_row({affected(RepairStatus::not_repairable, kAll)});
  EXPECT_THAT(row.help, AllOf(HasSubstr("1 file waits"), HasSubstr("all sides were up: --or-scan"),
                              HasSubstr("put the unit on the jig")));
}

TEST(UnitNeeds, WhatWasTriedIsNotAdvised) {
  UnitTable table({SourceKind::store, SourceKind::scan, SourceKind::unit_files});
  table.add(affected(RepairStatus::not_repairable, kAll));
  EXPECT_THAT(table.rows().at(0).help,
              AllOf(HasSubstr("all sides were up"), HasSubstr("do not suffice"),
                    HasSubstr("put the unit on the jig"), Not(HasSubstr("--or-scan"))));
  UnitTable named({SourceKind::calibration_file});
  named.add(affected(RepairStatus::not_repairable, kAll));
  EXPECT_THAT(named.rows().at(0).help, HasSubstr("--or-scan"));
  UnitAnswer together;
  together.row = UnitRow::missing;
  together.files = 2;
  UnitTable planned;
  planned.add("MOS2A1", together);
  EXPECT_THAT(planned.rows().at(0).help, Not(HasSubstr("--or-scan"))) << "a plan asked them";
}

TEST(UnitNeeds, AContradictionIsForAPerson) {
  auto report = affected(RepairStatus::not_repairable, {"+x"});
  report.for_a_person = true;
  const UnitNeeds row = only_row({report});
  EXPECT_TRUE(row.contradiction);
  EXPECT_THAT(row.help, AllOf(HasSubstr("contradicts itself"), HasSubstr("jig")));
}

TEST(UnitNeeds, WhatWasRepairedNeedsNothing) {
  const UnitNeeds row = only_row({affected(RepairStatus::repaired, {"+x"})});
  EXPECT_EQ(row.repaired, 1U);
  EXPECT_EQ(row.help, "");
}

TEST(UnitNeeds, ConstantsThatWereRefusedAreNotMissing) {
  auto refused = affected(RepairStatus::not_repairable, {"+x"});
  refused.source = SourceUsed{"store", "1", std::nullopt, std::nullopt};
  const UnitNeeds row = only_row({refused, affected(RepairStatus::outdated, {"+x"})});
  EXPECT_EQ(row.refused, 2U);
  EXPECT_EQ(row.waiting, 0U);
  EXPECT_THAT(row.help, AllOf(HasSubstr("reasons"), HasSubstr("the unit on the jig"),
                              HasSubstr("'sixpoint history MOS2A45130450'")));
  EXPECT_EQ(only_row({affected(RepairStatus::outdated, {"+x"})}).help,
            "1 file not written with the constants that there are: read the reasons");
}

// Who named other constants has not asked the unit's own still periods, whatever the order was.
TEST(UnitNeeds, WhereConstantsDoNotFitAndAllSidesWereUpTheyAreAdvised) {
  auto refused = affected(RepairStatus::not_repairable, {"+x", "-x", "+y"});
  auto other = affected(RepairStatus::not_repairable, {"-y", "+z", "-z"});
  const auto help = [&](const char* source) {
    refused.source = SourceUsed{source, "1", std::nullopt, std::nullopt};
    other.source = refused.source;
    UnitTable table({SourceKind::store, SourceKind::scan});
    table.add(refused);
    table.add(other);
    return table.rows().at(0).help;
  };
  EXPECT_THAT(help("store"), AllOf(HasSubstr("--scan in place of"), HasSubstr("history")));
  EXPECT_THAT(help("constants"), AllOf(HasSubstr("--scan in place of"), Not(HasSubstr("history"))));
  EXPECT_THAT(help("scan"), AllOf(HasSubstr("the unit on the jig"), Not(HasSubstr("--scan"))));
  EXPECT_THAT(help("unit_files"),
              AllOf(HasSubstr("the unit on the jig"), Not(HasSubstr("--scan"))));
}

TEST(UnitNeeds, FilesThatWereScannedAreNotCalledWaiting) {
  ScannedFile file;
  file.facts.serial = "MOS2A1";
  file.verdict = "affected";
  file.sides = {"+x", "-x", "+y", "-y", "+z"};
  UnitTable table;
  table.add(file);
  EXPECT_THAT(table.rows().at(0).help, AllOf(HasSubstr("repair"), HasSubstr("-z was never up")));
  file.sides = {"-z"};
  table.add(file);
  EXPECT_THAT(table.rows().at(0).help, HasSubstr("all sides were up"));
  EXPECT_EQ(table.rows().at(0).scanned, 2U);
}

TEST(UnitNeeds, AffectedUndecidedAndFailedFilesMakeARowOthersDoNot) {
  RepairReport sound;
  sound.serial = "TAS1";
  sound.verdict = "not_affected";
  sound.status = RepairStatus::not_affected;
  RepairReport undecided;
  undecided.serial = "MOS2A2";
  undecided.verdict = "cannot_tell";
  undecided.status = RepairStatus::not_repairable;
  UnitTable table;
  table.add(sound);
  table.add(undecided);
  table.add(RepairReport());  // failed
  const auto rows = table.rows();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].serial, "");
  EXPECT_EQ(rows[0].failed, 1U);
  EXPECT_EQ(rows[1].cannot_tell, 1U);
  EXPECT_EQ(rows[1].affected, 0U) << "it may be or not: nothing is guessed";
}

TEST(UnitNeeds, APlanKnowsWhatItsUnitsLack) {
  UnitAnswer missing;
  missing.row = UnitRow::missing;
  missing.files = 14;
  missing.missing_sides = {"-z"};
  UnitAnswer alone;
  alone.files = 1;
  alone.own_suffices = true;
  UnitTable table;
  table.add("MOS2A1", missing);
  table.add("MOS2A2", alone);
  const auto rows = table.rows();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_THAT(rows[0].help, AllOf(HasSubstr("14 files wait"), HasSubstr("-z was never up")));
  EXPECT_EQ(rows[1].waiting, 0U);
  // Of the units' other files the plan does not say how many there are.
  EXPECT_EQ(rows[0].affected, 14U);
  EXPECT_THAT(units_text(rows), HasSubstr("MOS2A1                -       14 "));
  EXPECT_TRUE(units_json(rows)[0]["files"].is_null());
}

TEST(UnitNeeds, TheTableIsTextCsvAndJson) {
  UnitTable table;
  auto report = affected(RepairStatus::not_repairable, {"+x"});
  for (const char* serial : {"MOS2A1", "MOS2A2", "bad,\"\x1b[31m"}) {
    report.serial = serial;
    table.add(report);
  }
  const auto rows = table.rows();
  const std::string text = units_text(rows, 2);
  EXPECT_THAT(text, AllOf(HasSubstr("MOS2A1"), HasSubstr("MOS2A2"), HasSubstr("... and 1 more")));
  EXPECT_EQ(text.find("bad"), std::string::npos);
  EXPECT_EQ(units_text(rows).find('\x1b'), std::string::npos) << "no escapes to a terminal";
  const std::string csv = units_csv(rows);
  EXPECT_THAT(csv, testing::StartsWith("unit,files,affected,repaired,waiting,"));
  EXPECT_THAT(csv, HasSubstr("\r\nMOS2A1,1,1,0,1,0,0,0,0,+x,-x +y -y +z -z,\""));
  EXPECT_THAT(csv, HasSubstr("\"bad,\"\""));
  const auto json = units_json(rows);
  ASSERT_EQ(json.size(), 3U);
  EXPECT_EQ(json[0]["sides_missing"].size(), 5U);
}

}  // namespace
}  // namespace sixpoint::repair
