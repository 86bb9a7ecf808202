// SIGINT (Ctrl-C) and SIGTERM, for commands that run until they are told to end.
//
//   const sigset_t signals = block_stop_signals();
//   int signal = 0;
//   sigwait(&signals, &signal);  // until Ctrl-C
//   take_stop(context, signal);
#pragma once

#include <csignal>

#include <pthread.h>

#include "cli/context.h"

namespace sixpoint::cli {

// From here on they wait for sigwait() or sigtimedwait() with the set that is returned. New threads
// inherit that. `before`: where the mask that was in force goes.
inline sigset_t block_stop_signals(sigset_t* before = nullptr) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, before);
  return signals;
}

// The exit code of a command that was ended so: 3 by Ctrl-C, as everywhere; 0 by SIGTERM, the word
// of what supervises services.
inline void take_stop(Context& context, int signal) {
  if (signal == SIGINT) {
    context.worsen(kExitStopped);
  }
}

}  // namespace sixpoint::cli
