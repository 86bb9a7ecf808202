#include "cli/stop_request.h"

#include <ctime>

#include <pthread.h>

namespace sixpoint::cli {

StopRequest::StopRequest() {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals_, &before_);
}

StopRequest::~StopRequest() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

bool StopRequest::requested() {
  const timespec at_once{};
  requested_ = requested_ || sigtimedwait(&signals_, nullptr, &at_once) > 0;
  return requested_;
}

}  // namespace sixpoint::cli
