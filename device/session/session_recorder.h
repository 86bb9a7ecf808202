// Writes down every transfer of a link (session.h).
//
//   SessionRecorder recorder;
//   SIXPOINT_CHECK(recorder.begin(env.files, "session.zip"));
//   auto unit = units.open(address, env, [&](Link& link) { recorder.attach(link); });
//   ... the program's work ...
//   SIXPOINT_CHECK(recorder.finish());
//
// Each transfer is on disk before the program sees it, in a journal beside the session
// (session_journal.h): the memory that it takes does not grow, and a program that is killed loses
// nothing.
#pragma once

#include <memory>
#include <mutex>

#include "device/session.h"
#include "device/transport.h"

namespace sixpoint::device {

class SessionRecorder {
 public:
  // What comes beyond is not kept, and the session says so. Counted are the bytes of transfers and
  // 64 for each: 100 MiB is what read_session() takes.
  explicit SessionRecorder(std::uint64_t most_bytes = 100ULL << 20U);

  // Makes the journal: cannot_create as SessionJournal::create(). `files` outlives the links.
  Status begin(FileSystem& files, const std::string& path);
  // From here on what passes on the link's channels is written down, also after it was opened
  // again. Once; the recorder may end before the link. Without begin() it does nothing.
  void attach(Link& link);
  // Makes the session of the journal; what passes afterwards is not kept. Where nothing was
  // attached there is no session. An error of the journal that came in between is given here: the
  // program's work went on, and what was written before it is left for recover_session().
  Status finish();
  bool truncated() const;

  struct Log;  // shared with the channels; defined in the source file

 private:
  std::shared_ptr<Log> log_;
};

}  // namespace sixpoint::device
