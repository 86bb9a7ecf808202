// sixpoint export by its contract: the CSV, and what it never writes over.
#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {

using gt3x::tests::made_log;
using gt3x::tests::put_recording;
using tests::run_command;

TEST(Export, WritesWholeFilesAndNeverOverARecording) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  ASSERT_OK(put_recording(memory.files, "other.gt3x", made_log(1)));
  const Bytes original = *read_file(memory.files, "f.gt3x");
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "f.gt3x"}).exit_code, 73);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "other.gt3x"}).exit_code, 73);
  EXPECT_EQ(*read_file(memory.files, "f.gt3x"), original);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "out.csv"}).exit_code, 0);
  const Bytes csv = *read_file(memory.files, "out.csv");
  const auto standard = run_command(memory.env, {"export", "f.gt3x", "--csv", "-"});
  EXPECT_EQ(standard.out, std::string(csv.begin(), csv.end()));
  memory.files.fail_after(2);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "late.csv"}).exit_code, 74);
  memory.files.stop_failing();
  EXPECT_FALSE(memory.files.info("late.csv"));
}

TEST(Export, WritesTheRecordsOfOneType) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  const auto lux = run_command(memory.env, {"export", "f.gt3x", "--records", "LUX", "--csv", "-"});
  EXPECT_EQ(lux.exit_code, 0);
  EXPECT_EQ(
      lux.out,
      "time,unix_s,lux\n2015-04-09T14:04:00,1428588240,7\n2015-04-09T14:04:01,1428588241,7\n");
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--records", "5", "--csv", "-"}).out,
            lux.out);
  const auto unknown =
      run_command(memory.env, {"export", "f.gt3x", "--records", "LIGHT", "--csv", "a.csv"});
  EXPECT_EQ(unknown.exit_code, 64);
  EXPECT_THAT(unknown.people, testing::HasSubstr("BATTERY"));
  EXPECT_FALSE(memory.files.info("a.csv"));
  EXPECT_EQ(
      run_command(memory.env, {"export", "f.gt3x", "--records", "LUX", "--imu", "--csv", "a.csv"})
          .exit_code,
      64);
}

TEST(Export, ARecordingWithoutTheInertialSensorIsRefused) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  const auto imu = run_command(memory.env, {"export", "f.gt3x", "--imu", "--csv", "a.csv"});
  EXPECT_EQ(imu.exit_code, 65);
  EXPECT_THAT(imu.people, testing::HasSubstr("SENSOR_SCHEMA"));
  EXPECT_FALSE(memory.files.info("a.csv"));
}

}  // namespace
}  // namespace sixpoint::cli
