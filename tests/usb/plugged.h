// What the bodies (bodies.cpp, fault_bodies.cpp) do with a bench again and again.
#pragma once

#include <string>
#include <thread>

#include "device/unit.h"
#include "device/usb/discovery.h"
#include "device/wire/wire_unit.h"
#include "usb/bench.h"

namespace sixpoint::tests {

// A unit that is plugged in until the test is over, however it ends.
class Plugged {
 public:
  Plugged(UsbBench& bench, BenchUnit unit, const std::string& port = {})
      : bench_(bench), unit_(std::move(unit)) {
    status_ = bench.plug_in(unit_, port);
  }
  ~Plugged() {
    if (!unit_.port.empty()) {
      bench_.unplug(unit_);
    }
  }
  Plugged(const Plugged&) = delete;
  Plugged& operator=(const Plugged&) = delete;
  BenchUnit& operator*() { return unit_; }
  BenchUnit* operator->() { return &unit_; }
  const Status& status() const { return status_; }

 private:
  UsbBench& bench_;
  BenchUnit unit_;
  Status status_;
};

inline const device::TransportRegistry& registry() {
  static const device::TransportRegistry registry = [] {
    device::TransportRegistry made;
    device::register_usb(made);
    return made;
  }();
  return registry;
}

// The kernel may still be at it: what the device needs for its nodes is part of opening.
inline Result<std::unique_ptr<device::Unit>> open(const std::string& address,
                                                  device::WireOptions options = {}) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  for (;;) {
    auto link = registry().open(address, posix_env());
    if (link) {
      return device::WireUnit::open(std::move(*link), options);
    }
    // In a kernel that has not enumerated it yet there is no such device.
    if (link.error().code != ErrorCode::device_unavailable ||
        std::chrono::steady_clock::now() > deadline) {
      return fail(link.error());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

// A recording of `recorded` of the unit's time, in a moment of ours.
inline Result<device::RecordingInfo> record(BenchUnit& bench_unit, device::Unit& unit,
                                            std::chrono::seconds recorded) {
  SIXPOINT_CHECK(unit.start_recording(100, from_unix_seconds(1'500'000'000)));
  bench_unit.clock->forward(recorded);
  SIXPOINT_CHECK(unit.stop_recording());
  SIXPOINT_ASSIGN(const auto list, unit.recordings());
  if (list.empty()) {
    return fail(ErrorCode::internal, "nothing was recorded");
  }
  return list.back();
}

}  // namespace sixpoint::tests
