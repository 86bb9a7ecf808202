// Writes down every transfer of a link (session.h).
//
//   SessionRecorder recorder;
//   auto unit = units.open(address, env, [&](Link& link) { recorder.attach(link); });
//   ... the program's work ...
//   recorder.save(env.files, "session.zip");
#pragma once

#include <memory>
#include <mutex>

#include "device/session.h"
#include "device/transport.h"

namespace sixpoint::device {

class SessionRecorder {
 public:
  // Memory: what comes beyond is not kept, and the session says so.
  explicit SessionRecorder(std::uint64_t most_bytes = 100ULL << 20U);

  // From here on what passes on the link's channels is written down, also after it was opened
  // again. Once; the recorder may end before the link.
  void attach(Link& link);
  Session session() const;
  // Also where nothing was attached: an empty session.
  Status save(FileSystem& files, const std::string& path) const;

  struct Log;  // shared with the channels; defined in the source file

 private:
  std::shared_ptr<Log> log_;
};

}  // namespace sixpoint::device
