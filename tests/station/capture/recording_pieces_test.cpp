#include "station/capture/recording_pieces.h"

#include <cstdlib>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "skip_unless.h"
#include "station/capture/capture_run.h"
#include "station/virtual_bench.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

// A recording of this unit, of three seconds a side.
void record(VirtualBench& bench, const std::string& path) {
  CaptureOptions options;
  options.output = path;
  options.side_s = 2;
  options.turn_s = 1;
  CaptureHooks hooks;
  hooks.ask = [](device::Pose, std::size_t, std::size_t) { return SideAnswer::placed; };
  ASSERT_OK(run_capture(bench.on_jig(), posix_env(), options, hooks));
}

// Oracle: unzip and cmp. The log of the file is the logs of the pieces, one after the other.
TEST(RecordingPieces, TheRecordsAreJoinedByteForByte) {
  SIXPOINT_SKIP_UNLESS(std::system("command -v unzip > /dev/null") == 0,
                       "unzip is missing; install the Debian package unzip");
  tests::TemporaryFolder folder;
  VirtualBench bench;
  record(bench, folder / "a.gt3x");
  record(bench, folder / "b.gt3x");
  ASSERT_OK(join_recordings(posix_env().files, {folder / "a.gt3x", folder / "b.gt3x"},
                            folder / "c.gt3x"));
  const std::string command = "cd " + folder.path() +
                              " && unzip -p a.gt3x log.bin > logs && test -s logs"
                              " && unzip -p b.gt3x log.bin >> logs"
                              " && unzip -p c.gt3x log.bin | cmp - logs";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

TEST(RecordingPieces, TwoUnitsAreNotJoined) {
  tests::TemporaryFolder folder;
  VirtualBench bench(7);
  VirtualBench other(8);
  record(bench, folder / "a.gt3x");
  record(other, folder / "b.gt3x");
  EXPECT_FAILS(
      join_recordings(posix_env().files, {folder / "a.gt3x", folder / "b.gt3x"}, folder / "c.gt3x"),
      ErrorCode::bad_data);
  EXPECT_FALSE(posix_env().files.info(folder / "c.gt3x"));
}

}  // namespace
}  // namespace sixpoint::station
