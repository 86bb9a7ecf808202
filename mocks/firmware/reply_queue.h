// Replies of a virtual device that its host has not asked for yet.
//
//   ReplyQueue replies;
//   replies.put(reply);
//   std::optional<device::Report> next = replies.take();  // the oldest
//
// A host that sends requests and never asks for a report gets the newest 64: without a limit it
// would take all memory. An honest host has one request in flight (docs/protocol.md). Samples are
// made when they are asked for, and never wait here.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "device/wire/protocol.h"

namespace sixpoint::mocks {

class ReplyQueue {
 public:
  static constexpr std::size_t kMost = 64;

  void put(const device::Report& reply) {
    if (waiting_.size() == kMost) {
      waiting_.pop_front();
    }
    waiting_.push_back(reply);
  }
  std::optional<device::Report> take() {
    if (waiting_.empty()) {
      return std::nullopt;
    }
    const device::Report reply = waiting_.front();
    waiting_.pop_front();
    return reply;
  }
  void clear() { waiting_.clear(); }

 private:
  std::deque<device::Report> waiting_;
};

}  // namespace sixpoint::mocks
