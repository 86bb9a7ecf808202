// Links that break or lie.
//
//   const auto broken = std::make_shared<Break>();
//   Link link = breaking(mocks::link_to(plugged, false), broken);
//   broken->left = 2;  // the third of the following calls fails, and no other
//   link = changed(std::move(link), {}, [](Message& reply) { reply.code = ReplyCode::busy; });
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "device/transport.h"
#include "device/wire/protocol.h"
#include "mocks/inert/inert.h"

namespace sixpoint::tests {

// Both channels of a link count their calls here; one of them fails.
struct Break {
  std::optional<std::size_t> left;  // calls before the one that fails
  ErrorCode code = ErrorCode::device_unavailable;
  bool happened = false;

  Status next_call() {
    if (!left || (*left)-- > 0) {
      return {};
    }
    left.reset();
    happened = true;
    return fail(code, "the cable was pulled", {}, "plug it in");
  }
};

class BreakingTransport final : public device::Transport {
 public:
  BreakingTransport(std::unique_ptr<device::Transport> inner, std::shared_ptr<Break> broken)
      : inner_(std::move(inner)), break_(std::move(broken)) {}
  Status write(std::span<const std::uint8_t> bytes, std::chrono::nanoseconds time_out) override {
    SIXPOINT_CHECK(break_->next_call());
    return inner_->write(bytes, time_out);
  }
  Result<std::size_t> read(std::span<std::uint8_t> out,
                           std::chrono::nanoseconds time_out) override {
    SIXPOINT_CHECK(break_->next_call());
    return inner_->read(out, time_out);
  }
  void cancel() override { inner_->cancel(); }

 private:
  std::unique_ptr<device::Transport> inner_;
  std::shared_ptr<Break> break_;
};

inline device::Link breaking(device::Link link, const std::shared_ptr<Break>& broken) {
  link.reports = std::make_unique<BreakingTransport>(std::move(link.reports), broken);
  if (link.bulk) {
    link.bulk = std::make_unique<BreakingTransport>(std::move(link.bulk), broken);
  }
  return link;
}

// Each message to the device and from it passes through a function, which may make another one of
// it; it goes on with the right CRC. A function may be empty.
using Change = std::function<void(device::Message&)>;
inline device::Link changed(device::Link link, const Change& on_write, const Change& on_read) {
  const auto tamper = [](const Change& change) {
    return [change](Bytes& bytes) {
      if (const auto message = device::decode(bytes); message && change) {
        device::Message other = *message;
        change(other);
        const device::Report report = device::encode(other);
        bytes.assign(report.begin(), report.end());
      }
      return 1;
    };
  };
  link.reports = std::make_unique<mocks::TamperingTransport>(std::move(link.reports),
                                                             tamper(on_write), tamper(on_read));
  return link;
}

}  // namespace sixpoint::tests
