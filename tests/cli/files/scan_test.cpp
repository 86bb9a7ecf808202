// sixpoint scan by its contract, case by case; repair_test.cpp scans a tree on the real disk.
#include <filesystem>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/made_agd.h"
#include "repair/made_recording.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using tests::MadeRecording;
using tests::run_command;

constexpr std::int64_t kBefore = 1'384'266'733;  // 2013-11-12
constexpr std::int64_t kAfter = 1'420'070'400;   // 2015-01-01

// Oracle: the vendor's rule. A unit calibrated before 2014-03-24 is affected under firmware 1.4.0
// to 1.7.0; firmware 1.6.0 also turns the axes.
TEST(Scan, TheVerdictFollowsFirmwareAndCalibration) {
  struct Case {
    const char* firmware;
    std::int64_t calibrated;
    const char* verdict;
    bool axes_rotated;
    int exit_code;
  };
  for (const Case& one :
       {Case{"1.3.0", kBefore, "not_affected", false, 0},
        Case{"1.4.0", kBefore, "affected", false, 1}, Case{"1.6.0", kBefore, "affected", true, 1},
        Case{"1.7.0", kBefore, "affected", false, 1},
        Case{"1.8.0", kBefore, "not_affected", false, 0},
        Case{"1.5.0", kAfter, "not_affected", false, 0}}) {
    SCOPED_TRACE(one.firmware);
    MemoryEnv memory;
    MadeRecording made;
    made.firmware = one.firmware;
    made.calibrated = one.calibrated;
    made.raw.assign(300, {60, 4, 300});
    ASSERT_OK(made.write(memory.files, "a.gt3x"));
    const auto answer = run_command(memory.env, {"scan", "a.gt3x", "--json"});
    EXPECT_EQ(answer.exit_code, one.exit_code);
    const Json json = answer.json();
    EXPECT_EQ(json["schema"], "sixpoint/scan/1");
    ASSERT_EQ(json["files"].size(), 1U);
    EXPECT_EQ(json["files"][0]["verdict"], one.verdict);
    EXPECT_EQ(json["files"][0]["axes_rotated"], one.axes_rotated);
    EXPECT_EQ(json["summary"][one.verdict], 1);
    EXPECT_EQ(json["summary"]["files"], 1);
  }
}

TEST(Scan, AFileThatCannotBeReadIsOneLineAndTheWorstExitCode) {
  MemoryEnv memory;
  ASSERT_OK(write_file(memory.files, "text.gt3x", "this is no zip"));
  const auto answer = run_command(memory.env, {"scan", "text.gt3x", "none.gt3x", "--json"});
  EXPECT_EQ(answer.exit_code, 66);
  EXPECT_EQ(answer.json()["summary"]["unreadable"], 2);
  EXPECT_TRUE(answer.json()["files"][0]["calibration_time"].is_null());
  EXPECT_EQ(run_command(memory.env, {"scan"}).exit_code, 64);
}

TEST(Scan, AFileThatThisUserMayNotReadIsAQuestionOfRights) {
  const tests::TemporaryFolder folder;
  using std::filesystem::perms;
  tests::make_agd(folder / "a.agd", "MOS2A1", "1.5.0");
  MadeRecording made;
  made.raw.assign(300, {60, 4, 300});
  ASSERT_OK(made.write(posix_env().files, folder / "a.gt3x"));
  std::filesystem::permissions(folder.path(), perms(0755));
  for (const char* name : {"a.agd", "a.gt3x"}) {
    std::filesystem::permissions(folder / name, perms::none);
    for (const char* command : {"scan", "inspect"}) {
      EXPECT_EQ(tests::exit_code_as_other_user({command, folder / name}, folder.path()), 77)
          << command << " " << name;
    }
  }
}

}  // namespace
}  // namespace sixpoint::cli
