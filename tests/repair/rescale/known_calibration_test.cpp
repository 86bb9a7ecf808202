#include "repair/rescale/known_calibration.h"

#include <gtest/gtest.h>

namespace sixpoint::repair {
namespace {

db::RepairRecord repair_of(const std::string& document) {
  db::RepairRecord record;
  record.document = document;
  return record;
}

db::RunRecord run_of(const std::string& document) {
  db::RunRecord record;
  record.document = document;
  return record;
}

constexpr const char* kIn2013 = R"({"calibration_time":"2013-11-12T14:32:13Z"})";
constexpr const char* kFoundIn2013 = R"({"as_found":{"calibrated":"2013-11-12T14:32:13Z"}})";
constexpr const char* kWrittenIn2026 = R"({"as_found":{"calibrated":"2013-11-12T14:32:13Z"},)"
                                       R"("as_left":{"calibrated":"2026-01-01T00:00:00Z"}})";

// The rows of the table in the header.
TEST(KnownCalibration, RecordsThatSayNothingGiveNothing) {
  db::UnitHistory history;
  EXPECT_TRUE(calibration_date(history).why.empty());
  for (const char* text : {"", "{}", "[1]", "null", R"({"calibration_time":null})",
                           R"({"calibration_time":5})", R"({"calibration_time":"yesterday"})"}) {
    history.repairs.push_back(repair_of(text));
  }
  for (const char* text : {"", "{}", R"({"as_found":null})", R"({"as_found":{"calibrated":1}})"}) {
    history.runs.push_back(run_of(text));
  }
  const KnownDate known = calibration_date(history);
  EXPECT_FALSE(known.time.has_value());
  EXPECT_TRUE(known.why.empty());
}

TEST(KnownCalibration, OneDateIsThatDateHoweverOftenItIsSaid) {
  db::UnitHistory history;
  history.runs.push_back(run_of(kFoundIn2013));
  const KnownDate of_run = calibration_date(history);
  EXPECT_EQ(of_run.time, from_unix_seconds(1'384'266'733));
  EXPECT_NE(of_run.why.find("jig run"), std::string::npos);
  history.repairs.push_back(repair_of(kIn2013));
  history.repairs.push_back(repair_of(kIn2013));
  const KnownDate of_both = calibration_date(history);
  EXPECT_EQ(of_both.time, from_unix_seconds(1'384'266'733));
  EXPECT_NE(of_both.why.find("repair"), std::string::npos);
}

TEST(KnownCalibration, SeveralDatesAreNone) {
  db::UnitHistory history;
  history.repairs.push_back(repair_of(kIn2013));
  history.runs.push_back(run_of(kWrittenIn2026));
  const KnownDate known = calibration_date(history);
  EXPECT_FALSE(known.time.has_value());
  EXPECT_NE(known.why.find("2 dates"), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::repair
