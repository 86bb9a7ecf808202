#include "station/lanes/continue_rule.h"

#include <functional>

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

UnfinishedRun a_left_run() {
  UnfinishedRun run;
  run.serial = "MOS2A45130007";
  run.operator_name = "Ada";
  run.station = "one";
  run.jig_id = "J-1";
  run.gravity_m_per_s2 = 9.81;
  return run;
}

// The table of run_goes_on(), row by row.
TEST(ContinueRule, ARunGoesOnWhereItWasBegun) {
  const auto with = [](const std::function<void(UnfinishedRun&)>& change) {
    UnfinishedRun now = a_left_run();
    change(now);
    return run_goes_on(a_left_run(), now);
  };
  EXPECT_EQ(with([](UnfinishedRun&) {}), true);
  EXPECT_EQ(with([](UnfinishedRun& now) { now.operator_name = "Bo"; }), true);
  EXPECT_EQ(with([](UnfinishedRun& now) { now.serial = "MOS2A45130008"; }), false);
  EXPECT_EQ(with([](UnfinishedRun& now) { now.protocol = JigProtocol::production_plus; }), false);
  EXPECT_EQ(with([](UnfinishedRun& now) { now.filter = calib::FilterConfiguration::legacy; }),
            false);
  EXPECT_FAILS(with([](UnfinishedRun& now) { now.jig_id = "J-2"; }), ErrorCode::usage);
  EXPECT_FAILS(with([](UnfinishedRun& now) { now.station = "two"; }), ErrorCode::usage);
  const auto gravity = with([](UnfinishedRun& now) { now.gravity_m_per_s2 = 9.83; });
  ASSERT_FALSE(gravity.has_value());
  EXPECT_THAT(gravity.error().brief(), testing::HasSubstr("9.81 m/s2"));
  EXPECT_THAT(gravity.error().hint, testing::HasSubstr("--anew"));
  UnfinishedRun nameless = a_left_run();
  nameless.jig_id = "";
  const auto named = run_goes_on(nameless, a_left_run());
  ASSERT_FALSE(named.has_value());
  EXPECT_THAT(named.error().hint, testing::StartsWith("leave --jig-id out"));
  // A folder of an earlier version.
  UnfinishedRun old = a_left_run();
  old.jig_id.reset();
  old.gravity_m_per_s2.reset();
  EXPECT_EQ(run_goes_on(old, a_left_run()), true);
}

TEST(ContinueRule, TheRecordNamesBoth) {
  EXPECT_EQ(both_names("Ada", "Bo"), "Ada, then Bo");
  EXPECT_EQ(both_names("Ada", "Ada"), "Ada");
  EXPECT_EQ(both_names("Ada, then Bo", "Bo"), "Ada, then Bo");
  EXPECT_EQ(both_names("", "Bo"), "Bo");
  EXPECT_EQ(both_names("Ada", ""), "Ada") << "a start that names nobody";
}

}  // namespace
}  // namespace sixpoint::station
