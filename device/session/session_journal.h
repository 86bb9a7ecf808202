// A session while it is being recorded: a journal beside its target, one line per transfer as it
// comes, made into the session's archive at the end.
//
//   SIXPOINT_ASSIGN(auto journal, SessionJournal::create(env.files, "session.zip"));
//   SIXPOINT_CHECK(journal.begin("hid:MOS2A45130007", env.clock.now()));
//   SIXPOINT_CHECK(journal.append(transfer));
//   SIXPOINT_CHECK(journal.finish(false));  // session.zip is there, the journal is not any more
//
// The target's name is never on anything but a whole session. A program that is killed leaves the
// journal with every transfer so far; a loss of power takes what was not yet on the medium, at most
// kJournalSync_bytes. recover_session() makes a session of either (docs/sessions.md).
//
// One thread at a time.
#pragma once

#include <memory>
#include <string>

#include "base/env.h"
#include "base/sha256.h"
#include "device/session/session.h"

namespace sixpoint::device {

// So much of a journal may be lost with the power: an fsync per 64 KiB is one in five seconds of a
// stream at 100 Hz.
inline constexpr std::uint64_t kJournalSync_bytes = 64ULL << 10U;

// "session.zip.journal"
std::string journal_of(const std::string& target);

class SessionJournal {
 public:
  // cannot_create where a journal of this name is there already, be it another program's or one
  // that was broken off: it is not overwritten. Locked until finish(), where the disk has locks.
  static Result<SessionJournal> create(FileSystem& files, const std::string& target);

  // Once, before the first transfer.
  Status begin(const std::string& device, UtcTime started);
  // Transfers in the order of their times.
  Status append(const SessionTransfer& transfer);
  // Once. Where nothing was begun there is no session, and nothing is left. When it fails the
  // journal stays, and the error names it.
  Status finish(bool truncated);

 private:
  SessionJournal(FileSystem& files, std::string target, std::unique_ptr<WritableFile> file,
                 std::unique_ptr<FileLock> lock)
      : files_(&files),
        target_(std::move(target)),
        file_(std::move(file)),
        lock_(std::move(lock)) {}
  Status write(std::string_view text);

  FileSystem* files_;
  std::string target_;
  std::shared_ptr<WritableFile> file_;
  std::shared_ptr<FileLock> lock_;
  SessionHead head_;
  Sha256 hash_;
  std::uint64_t lines_begin_ = 0;  // behind the first line; 0 before begin()
  std::uint64_t end_ = 0;
  std::uint64_t synced_ = 0;
};

struct RecoveredSession {
  std::string target;
  SessionHead head;
  std::uint64_t dropped_bytes = 0;  // behind the last whole transfer
};

// Makes `target` of what a journal holds, up to the first line that is no transfer, and removes the
// journal. The session says `truncated`. no_input where there is no journal, bad_data where it is
// none, cannot_create where `target` exists (refuse_existing()) or the journal's program still runs.
Result<RecoveredSession> recover_session(FileSystem& files, const std::string& journal,
                                         const std::string& target);

}  // namespace sixpoint::device
