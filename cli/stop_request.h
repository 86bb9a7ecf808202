// Ctrl-C (SIGINT) and SIGTERM for commands that end in order: what is begun is finished, what is
// done stays.
//
//   StopRequest stop;                // before threads are started: they inherit it
//   while (!stop.requested()) {
//     repair_the_next_file();
//   }
//   context.worsen(kExitStopped);
#pragma once

#include <csignal>

namespace sixpoint::cli {

// One at a time, on the thread that made it. The signals behave as before after it.
class StopRequest {
 public:
  StopRequest();
  StopRequest(const StopRequest&) = delete;
  StopRequest& operator=(const StopRequest&) = delete;
  ~StopRequest();

  // Did such a signal come? Once it did, the answer stays.
  bool requested();

 private:
  sigset_t signals_{};
  sigset_t before_{};
  bool requested_ = false;
};

}  // namespace sixpoint::cli
