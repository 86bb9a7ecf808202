// Records every transfer of a link (session.h).
//
//   SessionRecorder recorder;
//   SIXPOINT_CHECK(recorder.begin(env.files, "session.zip"));
//   const auto record = [&](Link& link) { recorder.attach(link); };
//   SIXPOINT_ASSIGN(const auto unit, units.open("hid:MOS2A45130007", env, record));
//   SIXPOINT_CHECK(unit->start_stream(100));  // the program's work
//   SIXPOINT_CHECK(recorder.finish());
//
// Each transfer is on disk before the program sees it, in a journal beside the session
// (session_journal.h): the memory that it takes does not grow, and a program that is killed loses
// nothing.
#pragma once

#include <memory>
#include <mutex>

#include "device/session/session.h"
#include "device/transport.h"

namespace sixpoint::device {

class SessionRecorder {
 public:
  // Later transfers are dropped, and the session is marked `truncated`. Counted are the bytes of
  // transfers and 64 for each: read_session() takes 100 MiB.
  explicit SessionRecorder(std::uint64_t most_bytes = 100ULL << 20U);

  // Makes the journal: cannot_create as SessionJournal::create(). `files` outlives the links.
  Status begin(FileSystem& files, const std::string& path);
  // Records the link's channels from here on, also after it was opened again. Once; the recorder
  // may end before the link. Without begin() it does nothing.
  void attach(Link& link);
  // Makes the session of the journal and ends the recording. Without a link there is no session. An
  // earlier error of the journal is returned here: the program's work went on, and the transfers
  // before the error are left for recover_session().
  Status finish();
  bool truncated() const;

  struct Log;  // shared with the channels; defined in the source file

 private:
  std::shared_ptr<Log> log_;
};

}  // namespace sixpoint::device
