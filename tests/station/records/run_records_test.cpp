#include "station/records/run_records.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "station/records/station_records.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

JigReport a_report() {
  JigReport report;
  report.serial = "MOS2A45130007";
  report.started = *parse_iso8601("2026-01-02T03:04:05");
  report.ended = *parse_iso8601("2026-01-02T03:06:05");
  report.verdict = JigVerdict::fail;
  report.codes = {"zero_high"};
  report.raw_csv = "t,x,y,z,c\n1,2,3,4,25\n";
  report.faces.resize(2);
  report.faces[0].temperature_c = 24;
  report.faces[1].temperature_c = 27;
  return report;
}

TEST(RunRecords, ARunIsCompletedFromItsReport) {
  db::RunRecord run = run_record_before({}, "MOS2A45130007", "J1");
  EXPECT_EQ(run.model, "wGT3X-BT");
  EXPECT_EQ(nlohmann::json::parse(run.limits)["run"]["rate_hz"], JigRunOptions().rate_hz);
  complete_run_record(run, a_report(), "spring");
  EXPECT_EQ(run.verdict, "fail");
  EXPECT_EQ(run.codes, std::vector<std::string>{"zero_high"});
  EXPECT_EQ(run.ended - run.started, std::chrono::minutes(2));
  EXPECT_DOUBLE_EQ(run.temperature_c.value_or(0), 25.5) << "mean of the faces";
  EXPECT_EQ(nlohmann::json::parse(run.document)["study"], "spring");
}

// A file's name may hold any bytes.
TEST(RunRecords, LimitsOfAFileWithAnyNameAreStored) {
  JigSessionOptions session;
  session.limits.source = "/limits-\xff.toml";
  const db::RunRecord run = run_record_before(session, "MOS2A45130007", "J1");
  EXPECT_EQ(nlohmann::json::parse(run.limits)["source"], "/limits-\xEF\xBF\xBD.toml");
}

TEST(RunRecords, AFailedRunIsStoredWithItsSamplesAndWithoutConstants) {
  const tests::TemporaryFolder folder;
  auto store = db::Store::open(posix_env(), folder / "s.db");
  ASSERT_OK(store);
  db::RunRecord run = run_record_before({}, "MOS2A45130007", "J1");
  complete_run_record(run, a_report());
  const auto ids = add_run_records(*store, a_report(), run);
  ASSERT_OK(ids);
  EXPECT_FALSE(ids->constants_id);
  const auto stored = store->run(ids->run_id);
  ASSERT_OK(stored);
  EXPECT_EQ(stored->jig, "J1");
  EXPECT_EQ(stored->software.substr(0, 9), "sixpoint ");
}

// The program ended after the write, and the unit did not come back.
TEST(RunRecords, AnInterruptedRunThatHasWrittenIsStoredWithItsWrite) {
  const tests::TemporaryFolder folder;
  auto store = db::Store::open(posix_env(), folder / "s.db");
  ASSERT_OK(store);
  JigReport report = a_report();
  report.verdict = JigVerdict::inconclusive;
  report.as_found = report.as_left = device::CalibrationPage{};
  report.as_left->constants.zero_lsb = {1, 2, 3};
  report.written = true;
  db::RunRecord run = run_record_before({}, "MOS2A45130007", "J1");
  complete_run_record(run, report);
  ASSERT_OK(add_run_records(*store, report, run));
  const auto history = store->unit_history("MOS2A45130007");
  ASSERT_OK(history);
  ASSERT_EQ(history->writes.size(), 1U);
  EXPECT_EQ(history->writes[0].as_left, history->writes[0].read_back);
}

}  // namespace
}  // namespace sixpoint::station
