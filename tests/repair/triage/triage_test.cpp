#include "repair/triage/triage.h"

#include <gtest/gtest.h>

namespace sixpoint::repair {
namespace {

using calib::FilterConfiguration;

FileFacts facts(const std::string& serial, const std::string& firmware, const char* calibrated) {
  FileFacts facts{serial, firmware, std::nullopt};
  if (calibrated != nullptr) {
    facts.calibration_time = parse_iso8601(calibrated).value();
  }
  return facts;
}

struct Case {
  const char* serial;
  const char* firmware;
  const char* calibrated;
  Verdict verdict;
};

// The rows are the paper's conditions and the design's table, each turned once.
TEST(Triage, FollowsTheTable) {
  constexpr auto kYes = Verdict::affected;
  constexpr auto kNo = Verdict::not_affected;
  constexpr auto kUnknown = Verdict::cannot_tell;
  for (const Case& c : std::initializer_list<Case>{
           {"MOS2A45130450", "1.4.0", "2013-11-12", kYes},
           {"MOS2A45130450", "1.4.1", "2013-11-12", kYes},
           {"MOS0A45130450", "1.5.0", "2013-11-12", kYes},
           {"mos2a45130450", "1.5.0", "2013-11-12", kYes},
           {"MOS4A45130450", "1.6.0", "2013-11-12", kYes},
           {"MOS3A45130450", "1.7.0", "2014-03-23T23:59:59", kYes},
           {"MOS2A45130450", "1.7.0", "2014-03-24", kNo},
           {"MOS2A45130450", "1.2.0", "2013-11-12", kNo},
           {"MOS2A45130450", "1.3.9", "2013-11-12", kNo},
           {"MOS2A45130450", "1.8.0", "2013-11-12", kNo},
           {"MOS2A45130450", "1.9.2", "2013-11-12", kNo},
           {"MOS2A45130450", "1.10.0", "2013-11-12", kNo},
           {"NEO1B34100019", "1.4.0", "2010-10-26", kNo},
           {"TAS1H30182785", "1.7.0", "2013-11-12", kNo},
           {"", "1.5.0", "2013-11-12", kUnknown},
           {"MOS2A45130450", "", "2013-11-12", kUnknown},
           {"MOS2A45130450", "1.5.0", nullptr, kUnknown},
           {"MOS2A45130450", "1.7.1", "2013-11-12", kUnknown},
           {"MOS2A45130450", "abc", "2013-11-12", kUnknown},
           {"MOS2A45130450", "", "2015-11-12", kNo},
           {"MOS2A45130450", "1.9.2", nullptr, kNo},
           {"MOS2A45130450", "1.5.0", "2011-12-31T23:59:59", kUnknown},
           {"MOS2A45130450", "1.5.0", "2012-01-01", kYes},
           {"MOS2A45130450", "1.9.2", "2000-01-01", kNo},
       }) {
    const Triage result = triage(facts(c.serial, c.firmware, c.calibrated));
    EXPECT_EQ(result.verdict, c.verdict) << c.serial << " " << c.firmware;
    EXPECT_FALSE(result.reasons.empty());
    EXPECT_EQ(result.axes_rotated, std::string_view(c.firmware) == "1.6.0");
  }
}

TEST(Triage, OfTwoUnitsNothingIsKnown) {
  for (const auto& [serial, other] : {std::pair{"MOS2A45130450", "MOS2A45130451"},
                                      {"TAS1H30182785", "MOS2A45130450"},
                                      {"MOS2A45130450", "TAS1H30182785"}}) {
    FileFacts two = facts(serial, "1.5.0", "2013-11-12");
    two.other_serial = other;
    const Triage result = triage(two);
    EXPECT_EQ(result.verdict, Verdict::cannot_tell);
    EXPECT_NE(result.reasons.front().find(other), std::string::npos) << result.reasons.front();
  }
}

TEST(Triage, TwoFirmwareVersionsAreTwoAnswersUnlessBothSayTheSame) {
  struct Row {
    const char* firmware;
    const char* other;
    const char* calibrated;
    Verdict verdict;
    bool rotated;
    bool filter_known;
  };
  for (const Row& row : std::initializer_list<Row>{
           {"1.5.0", "1.8.0", "2013-11-12", Verdict::cannot_tell, false, false},
           {"1.9.2", "1.5.0", "2013-11-12", Verdict::cannot_tell, false, false},
           {"1.5.0", "1.6.0", "2013-11-12", Verdict::cannot_tell, false, true},
           {"1.5.0", "1.4.1", "2013-11-12", Verdict::affected, false, true},
           {"1.5.0", "1.9.2", "2015-11-12", Verdict::not_affected, false, true},
       }) {
    FileFacts two = facts("MOS2A45130450", row.firmware, row.calibrated);
    two.other_firmware = row.other;
    const Triage result = triage(two);
    EXPECT_EQ(result.verdict, row.verdict) << row.firmware << " " << row.other;
    EXPECT_EQ(result.axes_rotated, row.rotated) << row.firmware << " " << row.other;
    EXPECT_EQ(filter_in_force(two).has_value(), row.filter_known) << row.firmware << row.other;
    EXPECT_NE(result.reasons.back().find(row.other), std::string::npos) << result.reasons.back();
  }
}

TEST(Triage, KnowsTheConfigurations) {
  const auto legacy = FilterConfiguration::legacy;
  const auto current = FilterConfiguration::current;
  const FileFacts old_unit = facts("MOS2A1", "1.5.0", "2013-11-12");
  EXPECT_EQ(filter_in_force(old_unit), current);
  EXPECT_EQ(filter_of_constants(old_unit), legacy);
  EXPECT_EQ(filter_in_force(facts("MOS2A1", "1.2.0", "2013-11-12")), legacy);
  EXPECT_EQ(filter_in_force(facts("MOS2A1", "1.8.0", "2013-11-12")), legacy);
  EXPECT_EQ(filter_in_force(facts("MOS2A1", "1.5.0", "2014-03-24")), current);
  EXPECT_EQ(filter_in_force(facts("MOS2A1", "", "2015-03-24")), current);
  EXPECT_EQ(filter_in_force(facts("MOS2A1", "1.8.0", nullptr)), std::nullopt);
  EXPECT_EQ(filter_of_constants(facts("MOS2A1", "1.8.0", "2000-01-01")), std::nullopt);
  EXPECT_EQ(filter_in_force(facts("TAS1", "1.5.0", "2015-03-24")), std::nullopt);
}

TEST(Firmware, Parses) {
  EXPECT_EQ(parse_firmware("1.10.2"), (FirmwareVersion{1, 10, 2}));
  EXPECT_EQ(parse_firmware("v1.5"), (FirmwareVersion{1, 5, 0}));
  EXPECT_LT(*parse_firmware("1.9.2"), *parse_firmware("1.10.0"));
  for (const char* wrong : {"", "1", "1.", "1.5.0.3", "a.b", "1.5x", "1.-5.0", "99999999999.1.1"}) {
    EXPECT_EQ(parse_firmware(wrong), std::nullopt) << wrong;
  }
}

}  // namespace
}  // namespace sixpoint::repair
