// Signals that ask a command to end: Ctrl-C (SIGINT), SIGTERM, and SIGHUP, which comes when the
// terminal is closed. A command that was started to outlive its terminal (nohup: SIGHUP is ignored)
// does. A command that ends in order finishes what is begun and keeps what is done:
//
//   StopRequest stop;                // before threads are started: they inherit it
//   while (!stop.requested()) {
//     repair_the_next_file();
//   }
//   context.worsen(kExitStopped);
//
// A command that runs until it is told to end waits for one of block_stop_signals(), then calls
// take_stop() (context.h).
#pragma once

#include <csignal>

namespace sixpoint::cli {

// From here on they wait for sigwait() or sigtimedwait() with the set that is returned. New threads
// inherit that. `before`: where the mask that was in force goes.
sigset_t block_stop_signals(sigset_t* before = nullptr);

// One at a time, on the thread that made it. The signals behave as before after it. A reader of the
// output that goes away (SIGPIPE) asks for an end, too, where that thread writes.
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
