#include "cli/station/record_option.h"

#include <sstream>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "cli/devices/known_devices.h"
#include "device/session/session.h"
#include "device/wire/protocol.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;

struct Recorded {
  // Opens the virtual unit, which asks it once who it is.
  void open_a_unit() {
    const auto record = [this](device::Link& link) { recorder.attach(link); };
    ASSERT_OK(station::known_units().open("virtual:seed=7", memory.env, record));
  }

  MemoryEnv memory;
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{memory.env, out, people, in};
  Outputs outputs{context, {}, /*json=*/false};
  device::SessionRecorder recorder;
};

// Oracle: docs/protocol.md. A station that opens a unit sends IDENTIFY (1) with sequence 0 and gets
// one reply.
TEST(RecordOption, TheSessionHasWhatPassed) {
  Recorded recorded;
  ASSERT_OK(begin_session(recorded.outputs, recorded.recorder, "s.zip"));
  recorded.open_a_unit();
  finish_session(recorded.context, recorded.recorder, "s.zip");
  EXPECT_EQ(recorded.context.exit_code, 0) << recorded.people.str();
  const auto session = device::read_session(recorded.memory.files, "s.zip");
  ASSERT_OK(session);
  EXPECT_EQ(session->device, "virtual:seed=7");
  ASSERT_EQ(session->transfers.size(), 2U);
  EXPECT_EQ(session->transfers[0].kind, device::SessionTransfer::Kind::to_device);
  ASSERT_EQ(session->transfers[0].bytes.size(), 64U);
  EXPECT_EQ(Bytes(session->transfers[0].bytes.begin(), session->transfers[0].bytes.begin() + 5),
            (Bytes{1, 1, 0, 0, 1}));
  EXPECT_EQ(session->transfers[1].kind, device::SessionTransfer::Kind::from_device);
}

// Before anything is opened, and not when the work is done.
TEST(RecordOption, AFileThatIsThereIsRefusedBeforeTheWork) {
  Recorded recorded;
  ASSERT_OK(recorded.memory.files.create("s.zip"));
  EXPECT_FAILS(begin_session(recorded.outputs, recorded.recorder, "s.zip"),
               ErrorCode::cannot_create);
  EXPECT_FALSE(recorded.memory.files.info("s.zip.journal"));
}

TEST(RecordOption, WithoutANameNothingIsWritten) {
  Recorded recorded;
  ASSERT_OK(begin_session(recorded.outputs, recorded.recorder, ""));
  recorded.open_a_unit();
  finish_session(recorded.context, recorded.recorder, "");
  EXPECT_EQ(recorded.memory.files.changing_operations(), 0U);
  EXPECT_EQ(recorded.context.exit_code, 0);
  EXPECT_EQ(recorded.people.str(), "");
}

// The exit code of the contract for a disk that fails is 74.
TEST(RecordOption, ASessionThatCannotBeMadeIsReported) {
  Recorded recorded;
  ASSERT_OK(begin_session(recorded.outputs, recorded.recorder, "s.zip"));
  recorded.open_a_unit();
  recorded.memory.files.fail_after(0);
  finish_session(recorded.context, recorded.recorder, "s.zip");
  EXPECT_EQ(recorded.context.exit_code, 74);
  EXPECT_THAT(recorded.people.str(), HasSubstr("sixpoint: "));
  recorded.memory.files.stop_failing();
  EXPECT_FALSE(recorded.memory.files.info("s.zip"));
}

// A recorder of 150 bytes has room for one report of 64 and its 64, and not for two
// (session_recorder.h). The work is done all the same: a warning, and exit code 0.
TEST(RecordOption, ASessionThatIsTooLongSaysSo) {
  Recorded recorded;
  device::SessionRecorder brief(150);
  ASSERT_OK(begin_session(recorded.outputs, brief, "s.zip"));
  ASSERT_OK(station::known_units().open("virtual:seed=7", recorded.memory.env,
                                        [&](device::Link& link) { brief.attach(link); }));
  finish_session(recorded.context, brief, "s.zip");
  EXPECT_EQ(recorded.context.exit_code, 0);
  EXPECT_THAT(recorded.people.str(), HasSubstr("s.zip: the session is longer"));
  const auto session = device::read_session(recorded.memory.files, "s.zip");
  ASSERT_OK(session);
  EXPECT_TRUE(session->truncated);
  EXPECT_EQ(session->transfers.size(), 1U);
}

}  // namespace
}  // namespace sixpoint::cli
