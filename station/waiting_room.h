// Connections whose request is not there yet. One thread looks after all of them, so that a client
// which connects and says nothing, or says it a letter at a time, costs a descriptor and no thread.
//
// What has come whole, head and announced body, is handed on; what takes longer than the time-out
// is closed, and so is the oldest when there are too many. Memory is at most `most_connections`
// times `most_head_bytes` and `most_body_bytes`.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "base/result.h"

namespace sixpoint::station {

struct WaitingRoomOptions {
  std::size_t most_connections = 512;
  std::size_t most_head_bytes = 16U << 10U;  // a browser's request is below 2 KiB
  std::size_t most_body_bytes = 64U << 10U;  // one that announces more is handed on without it
  std::chrono::milliseconds time_out{5000};  // from connecting to the end of the request
};

class WaitingRoom {
 public:
  // Takes over the socket and what was read from it; called on the room's own thread.
  using Serve = std::function<void(int socket, std::string request)>;

  WaitingRoom(const WaitingRoomOptions& options, Serve serve);
  ~WaitingRoom();  // as stop()
  WaitingRoom(const WaitingRoom&) = delete;
  WaitingRoom& operator=(const WaitingRoom&) = delete;

  void enter(int socket);  // takes it over; from any thread
  void stop();             // closes all that wait; nothing is served afterwards

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station
