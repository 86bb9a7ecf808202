#include "cli/stop_request.h"

#include <ctime>

#include <pthread.h>

namespace sixpoint::cli {

namespace {

// A signal that is blocked waits even where it is ignored.
void add_unless_ignored(int signal, sigset_t& signals) {
  struct sigaction now {};
  if (::sigaction(signal, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) {
    sigaddset(&signals, signal);
  }
}

}  // namespace

sigset_t block_stop_signals(sigset_t* before) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  add_unless_ignored(SIGHUP, signals);
  pthread_sigmask(SIG_BLOCK, &signals, before);
  return signals;
}

StopRequest::StopRequest() : signals_(block_stop_signals(&before_)) {
  add_unless_ignored(SIGPIPE, signals_);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
}

StopRequest::~StopRequest() {
  // What was written after the reader went must not end the program now.
  sigset_t broken_pipe;
  sigemptyset(&broken_pipe);
  sigaddset(&broken_pipe, SIGPIPE);
  const timespec at_once{};
  sigtimedwait(&broken_pipe, nullptr, &at_once);
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

bool StopRequest::requested() {
  const timespec at_once{};
  requested_ = requested_ || sigtimedwait(&signals_, nullptr, &at_once) > 0;
  return requested_;
}

}  // namespace sixpoint::cli
