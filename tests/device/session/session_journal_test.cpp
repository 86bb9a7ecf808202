#include "device/session/session_journal.h"

#include <csignal>

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "device/wire/wire_unit.h"
#include "failing_files.h"
#include "made_session.h"
#include "temporary_folder.h"

namespace sixpoint::device {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const Session& whole() {
  static const Session kSession = tests::made_session();
  return kSession;
}

// Records whole() as a program would, up to the first error.
Status record_whole(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto journal, SessionJournal::create(files, path));
  SIXPOINT_CHECK(journal.begin(whole().device, whole().started));
  for (const SessionTransfer& transfer : whole().transfers) {
    SIXPOINT_CHECK(journal.append(transfer));
  }
  return journal.finish(false);
}

void expect_beginning_of_whole(const Session& session) {
  EXPECT_EQ(session.device, whole().device);
  EXPECT_EQ(session.started, whole().started);
  ASSERT_LE(session.transfers.size(), whole().transfers.size());
  EXPECT_TRUE(
      std::equal(session.transfers.begin(), session.transfers.end(), whole().transfers.begin()));
}

TEST(SessionJournal, BecomesTheSessionThatIsWrittenAtOnce) {
  MemoryFiles files;
  ASSERT_OK(record_whole(files, "s.zip"));
  ASSERT_OK(write_session(files, "at_once.zip", whole()));
  EXPECT_EQ(*read_file(files, "s.zip"), *read_file(files, "at_once.zip"));
  EXPECT_THAT(*files.list("."), ElementsAre("at_once.zip", "s.zip")) << "no journal is left";
}

TEST(SessionJournal, WhereNothingWasBegunNothingIsLeft) {
  MemoryFiles files;
  SessionRecorder recorder;
  ASSERT_OK(recorder.begin(files, "s.zip"));
  ASSERT_OK(recorder.finish());
  EXPECT_THAT(*files.list("."), IsEmpty());
}

TEST(SessionJournal, AnotherJournalIsNotOverwritten) {
  MemoryFiles files;
  {
    auto first = SessionJournal::create(files, "s.zip");
    ASSERT_OK(first);
    ASSERT_OK(first->begin("virtual:", UtcTime{}));
    SessionRecorder second;
    const Status refused = second.begin(files, "s.zip");
    EXPECT_FAILS(refused, ErrorCode::cannot_create);
    EXPECT_THAT(refused.error().what, HasSubstr("still being recorded"));
    EXPECT_FAILS(recover_session(files, "s.zip.journal", "s.zip"), ErrorCode::cannot_create);
    EXPECT_FALSE(files.info("s.zip"));
    ASSERT_TRUE(files.info("s.zip.journal"));
  }  // as the end of a program that is killed
  SessionRecorder second;
  const Status refused = second.begin(files, "s.zip");
  EXPECT_FAILS(refused, ErrorCode::cannot_create);
  EXPECT_THAT(refused.error().hint, HasSubstr("sixpoint session recover s.zip"));
  EXPECT_OK(recover_session(files, "s.zip.journal", "s.zip"));
  const tests::TemporaryFolder folder;
  EXPECT_FAILS(SessionJournal::create(posix_env().files, folder / "no/such/s.zip"),
               ErrorCode::cannot_create);
}

// The disk fails at each operation in turn: the target is whole or not there, and what was recorded
// before can be recovered.
TEST(SessionJournal, ADiskThatFailsAtAnyOperationLeavesNothingHalfWritten) {
  MemoryFiles counting;
  ASSERT_OK(record_whole(counting, "s.zip"));
  const std::size_t operations = counting.changing_operations();
  ASSERT_GT(operations, whole().transfers.size());
  int recovered_some = 0;
  for (std::size_t after = 0; after < operations; ++after) {
    SCOPED_TRACE(after);
    MemoryFiles files;
    files.fail_after(after);
    const Status recorded = record_whole(files, "s.zip");
    files.stop_failing();
    if (recorded || files.info("s.zip")) {
      const auto session = read_session(files, "s.zip");
      ASSERT_OK(session);
      EXPECT_EQ(session->transfers, whole().transfers);
      continue;
    }
    const auto recovered = recover_session(files, "s.zip.journal", "s.zip");
    if (!recovered) {
      EXPECT_LT(after, 3U) << "before there was anything to keep: " << recovered.error().brief();
      EXPECT_FALSE(files.info("s.zip"));
      continue;
    }
    const auto session = read_session(files, "s.zip");
    ASSERT_OK(session);
    EXPECT_TRUE(session->truncated);
    expect_beginning_of_whole(*session);
    EXPECT_FALSE(files.info("s.zip.journal"));
    ++recovered_some;
  }
  EXPECT_GT(recovered_some, static_cast<int>(whole().transfers.size()));
}

// The power fails instead: what was synced is there, and nothing half-written has the name.
TEST(SessionJournal, APowerCutLosesNoMoreThanWasNotSynced) {
  MemoryFiles counting;
  ASSERT_OK(record_whole(counting, "s.zip"));
  const std::size_t operations = counting.changing_operations();
  for (std::size_t after = 0; after < operations; after += 3) {
    SCOPED_TRACE(after);
    MemoryFiles files;
    files.fail_after(after);
    static_cast<void>(record_whole(files, "s.zip"));
    files.stop_failing();
    files.lose_power();
    if (files.info("s.zip")) {
      EXPECT_EQ(read_session(files, "s.zip")->transfers, whole().transfers);
    } else if (const auto recovered = recover_session(files, "s.zip.journal", "s.zip"); recovered) {
      expect_beginning_of_whole(*read_session(files, "s.zip"));
    }
  }
  // Long enough for a sync.
  MemoryFiles files;
  const SessionTransfer block{
      SessionTransfer::Kind::from_device, SessionChannel::bulk, {}, Bytes(1000, 7), {}};
  constexpr std::size_t kBlocks = 100;
  {
    auto journal = *SessionJournal::create(files, "s.zip");
    ASSERT_OK(journal.begin("virtual:", UtcTime{}));
    for (std::size_t i = 0; i < kBlocks; ++i) {
      ASSERT_OK(journal.append(block));
    }
    files.lose_power();
  }
  ASSERT_OK(recover_session(files, "s.zip.journal", "s.zip"));
  const auto session = read_session(files, "s.zip");
  ASSERT_OK(session);
  const std::size_t most_lost = kJournalSync_bytes / 2000 + 1;
  EXPECT_GE(session->transfers.size(), kBlocks - most_lost);
  EXPECT_EQ(session->transfers.front(), block);
}

// A journal that ends at any byte, as a killed program's does.
TEST(SessionJournal, IsRecoveredUpToItsLastWholeTransfer) {
  MemoryFiles files;
  {
    auto journal = *SessionJournal::create(files, "s.zip");
    ASSERT_OK(journal.begin(whole().device, whole().started));
    for (std::size_t i = 0; i < 6; ++i) {
      ASSERT_OK(journal.append(whole().transfers[i]));
    }
  }
  const Bytes bytes = *read_file(files, "s.zip.journal");
  const std::string text(bytes.begin(), bytes.end());
  for (std::size_t size = 0; size <= text.size(); ++size) {
    SCOPED_TRACE(size);
    MemoryFiles disk;
    const std::string cut = text.substr(0, size);
    ASSERT_OK(write_file(disk, "s.zip.journal", cut));
    const auto lines = static_cast<std::size_t>(std::count(cut.begin(), cut.end(), '\n'));
    const auto recovered = recover_session(disk, "s.zip.journal", "s.zip");
    if (lines == 0) {
      EXPECT_FAILS(recovered, ErrorCode::bad_data);
      EXPECT_TRUE(disk.info("s.zip.journal")) << "it is not thrown away";
      continue;
    }
    ASSERT_OK(recovered);
    EXPECT_EQ(recovered->head.transfers, lines - 1);
    EXPECT_EQ(recovered->dropped_bytes, size - (cut.rfind('\n') + 1));
    const auto session = read_session(disk, "s.zip");
    ASSERT_OK(session);
    EXPECT_EQ(session->transfers.size(), lines - 1);
    expect_beginning_of_whole(*session);
  }
  // What a power cut puts behind: zeros, or the end of another file.
  for (const std::string& behind :
       {std::string(5000, '\0'), std::string("{\"t_ns\":1}\n"), std::string(3U << 20U, 'x')}) {
    MemoryFiles disk;
    ASSERT_OK(write_file(disk, "s.zip.journal", text + behind));
    const auto recovered = recover_session(disk, "s.zip.journal", "s.zip");
    ASSERT_OK(recovered);
    EXPECT_EQ(recovered->head.transfers, 6U);
    EXPECT_EQ(recovered->dropped_bytes, behind.size());
  }
}

TEST(SessionJournal, RecoveryOverwritesNothingAndAnOpenSaysWhatToDo) {
  MemoryFiles files;
  ASSERT_OK(SessionJournal::create(files, "s.zip")->begin("virtual:", UtcTime{}));
  const auto missing = read_session(files, "s.zip");
  EXPECT_FAILS(missing, ErrorCode::no_input);
  EXPECT_THAT(missing.error().hint, HasSubstr("sixpoint session recover s.zip"));
  ASSERT_OK(write_file(files, "s.zip", "precious"));
  EXPECT_FAILS(recover_session(files, "s.zip.journal", "s.zip"), ErrorCode::cannot_create);
  EXPECT_EQ(read_file(files, "s.zip")->size(), 8U);
  EXPECT_FAILS(recover_session(files, "none.journal", "n.zip"), ErrorCode::no_input);
  ASSERT_OK(write_file(files, "other.journal", "{\"schema\":\"sixpoint/session/1\"}\n"));
  EXPECT_FAILS(recover_session(files, "other.journal", "n.zip"), ErrorCode::bad_data);
}

// A disk that is full in mid-run: the work goes on, the recorder fails at the end.
TEST(SessionJournal, AFullDiskDoesNotDisturbTheWork) {
  MemoryFiles files;
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  Link link = mocks::link_to(
      std::make_shared<mocks::PluggedUnit>(options, std::make_shared<ManualClock>()), false);
  SessionRecorder recorder;
  ASSERT_OK(recorder.begin(files, "s.zip"));
  recorder.attach(link);
  const auto unit = *WireUnit::open(std::move(link));
  files.fail_after(0);
  EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants);
  files.stop_failing();
  const Status finished = recorder.finish();
  EXPECT_FAILS(finished, ErrorCode::io);
  EXPECT_THAT(finished.error().hint, HasSubstr("session recover s.zip"));
  EXPECT_FALSE(files.info("s.zip"));
  ASSERT_OK(recover_session(files, "s.zip.journal", "s.zip"));
  EXPECT_EQ(read_session(files, "s.zip")->transfers.size(), 2U) << "identify and its reply";
}

// "Free some space and run the command again": that was refused, for the journal is there.
TEST(SessionJournal, ASessionThatCannotBeFinishedSaysWhatCanBeDone) {
  MemoryFiles files;
  auto journal = SessionJournal::create(files, "s.zip");
  ASSERT_OK(journal);
  ASSERT_OK(journal->begin(whole().device, whole().started));
  files.fail_after(0);
  const Status finished = journal->finish(false);
  files.stop_failing();
  EXPECT_FAILS(finished, ErrorCode::io);
  EXPECT_EQ(finished.error().where, "s.zip");
  EXPECT_EQ(finished.error().hint,
            "the transfers are in s.zip.journal; put that right, then: sixpoint session recover "
            "s.zip");
}

// kill -9, on a real disk: every transfer that the program had is there.
TEST(SessionJournal, AKilledProgramLosesNoTransfer) {
  const tests::TemporaryFolder folder;
  const std::string path = folder / "k.zip";
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto journal = SessionJournal::create(posix_env().files, path);
    if (journal && journal->begin(whole().device, whole().started)) {
      for (std::size_t i = 0; i < 31; ++i) {
        static_cast<void>(journal->append(whole().transfers[i]));
      }
    }
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(posix_env().files.info(path)) << "the target's name is on nothing half-written";
  ASSERT_OK(recover_session(posix_env().files, journal_of(path), path));
  const auto session = read_session(posix_env().files, path);
  ASSERT_OK(session);
  EXPECT_EQ(session->transfers.size(), 31U);
  expect_beginning_of_whole(*session);
}

// Whatever call of the disk fails: it is said, and the journal holds the beginning.
TEST(SessionJournal, EachCallOfTheDiskMayFail) {
  for (std::size_t call = 0;; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    MemoryFiles memory;
    tests::FailingFiles files(memory);
    files.fail_at(call);
    const Status recorded = record_whole(files, "s.zip");
    if (!files.has_failed()) {
      EXPECT_OK(recorded);
      EXPECT_GT(call, 5U);
      break;
    }
    if (recorded) {  // the journal was closed in vain, behind a session that is whole
      EXPECT_EQ(read_session(memory, "s.zip")->transfers, whole().transfers);
      continue;
    }
    EXPECT_EQ(recorded.error().code, ErrorCode::io);
    if (memory.info(journal_of("s.zip")) && !memory.info("s.zip")) {
      const auto recovered = recover_session(memory, journal_of("s.zip"), "r.zip");
      if (recovered) {
        const auto session = read_session(memory, "r.zip");
        ASSERT_OK(session);
        expect_beginning_of_whole(*session);
      } else {  // broken before its first line was whole
        EXPECT_EQ(recovered.error().code, ErrorCode::bad_data) << recovered.error().brief();
      }
    }
  }
}

TEST(SessionJournal, RecoveringAndReadingMayFailAtEachCall) {
  MemoryFiles memory;
  auto journal = *SessionJournal::create(memory, "s.zip");
  ASSERT_OK(journal.begin(whole().device, whole().started));
  for (const SessionTransfer& transfer : whole().transfers) {
    ASSERT_OK(journal.append(transfer));
  }
  const Bytes bytes = *read_file(memory, journal_of("s.zip"));
  ASSERT_OK(write_session(memory, "whole.zip", whole()));
  bool recovered = false;
  bool read = false;
  for (std::size_t call = 0; !recovered || !read; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    const std::string name = std::to_string(call);
    ASSERT_OK(write_file(memory, name + ".journal", as_text(bytes)));
    tests::FailingFiles files(memory);
    files.fail_at(call);
    const auto result = recover_session(files, name + ".journal", name + ".zip");
    recovered = !files.has_failed();
    EXPECT_EQ(result.has_value(), recovered);
    files.fail_at(call);
    const auto session = read_session(files, "whole.zip");
    read = !files.has_failed();
    files.stop_failing();
    EXPECT_EQ(session.has_value(), read);
    files.fail_at(call);
    const Status written = write_session(files, name + ".written.zip", whole());
    EXPECT_EQ(written.has_value(), !files.has_failed());
    // The last call syncs the folder: the session is there, and that it stays is not sure.
    if (written || memory.info(name + ".written.zip")) {
      EXPECT_EQ(read_session(memory, name + ".written.zip")->transfers, whole().transfers);
    }
  }
}

// It may be anybody's file: it is not made into a session, and not removed.
TEST(SessionJournal, AFileThatBeginsOtherwiseIsNoJournal) {
  const std::string schema = R"("schema":"sixpoint/session-journal/1")";
  const std::string started = R"("started":"2020-09-13T12:26:40Z")";
  const auto recover = [](MemoryFiles& files, const std::string& first_line) {
    EXPECT_OK(write_file(files, "s.zip.journal", first_line + "\n"));
    return recover_session(files, "s.zip.journal", "s.zip");
  };
  MemoryFiles whole_one;
  EXPECT_OK(recover(whole_one, "{" + schema + "," + started + "}"));
  EXPECT_EQ(read_session(whole_one, "s.zip")->device, "") << "it may lack the device's name";
  for (const std::string& line :
       {std::string(), std::string("no JSON"), std::string("[1]"), "{" + started + "}",
        R"({"schema":1,)" + started + "}", R"({"schema":"sixpoint/session/1",)" + started + "}",
        "{" + schema + "}", "{" + schema + R"(,"started":5})",
        "{" + schema + R"(,"started":"x"})"}) {
    SCOPED_TRACE(line);
    MemoryFiles files;
    const auto recovered = recover(files, line);
    EXPECT_FAILS(recovered, ErrorCode::bad_data);
    EXPECT_EQ(recovered.error().what, "this is no journal of a session");
    EXPECT_TRUE(files.info("s.zip.journal"));
    EXPECT_FALSE(files.info("s.zip"));
  }
}

// Bytes of an older file may look like a transfer: one that was before the last is none of these.
TEST(SessionJournal, ATransferThatGoesBackInTimeEndsIt) {
  MemoryFiles files;
  {
    auto journal = *SessionJournal::create(files, "s.zip");
    ASSERT_OK(journal.begin("virtual:", UtcTime{}));
    SessionTransfer transfer{SessionTransfer::Kind::from_device,
                             SessionChannel::bulk,
                             std::chrono::nanoseconds(5),
                             Bytes{1},
                             {}};
    ASSERT_OK(journal.append(transfer));
    transfer.time = std::chrono::nanoseconds(4);
    ASSERT_OK(journal.append(transfer));
  }
  const auto recovered = recover_session(files, "s.zip.journal", "s.zip");
  ASSERT_OK(recovered);
  EXPECT_EQ(recovered->head.transfers, 1U);
  EXPECT_GT(recovered->dropped_bytes, 0U);
  EXPECT_EQ(read_session(files, "s.zip")->transfers.size(), 1U);
}

}  // namespace
}  // namespace sixpoint::device
