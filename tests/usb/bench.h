// What the USB tests need of a carrier: units that can be plugged in, pulled out and inspected.
//
// The bodies (bodies.h) run over umockdev, where the kernel is played, and in qemu, where it is
// real. A carrier implements UsbBench; the units are virtual in both and live in the test's
// process.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "mocks/in_process/in_process.h"
#include "mocks/in_process/scaled_clock.h"
#include "mocks/usb/usb_unit.h"
#include "sim/unit_truth.h"

namespace sixpoint::tests {

// The machine's time, with leaps: a recording of an hour must not take one. With a pace, that many
// times faster.
class LeapingClock final : public Clock {
 public:
  explicit LeapingClock(int pace = 1) : clock_(posix_env().clock, pace) {}
  UtcTime now() override {
    return clock_.now() + std::chrono::duration_cast<UtcTime::duration>(leap());
  }
  std::chrono::nanoseconds elapsed() override { return clock_.elapsed() + leap(); }
  void sleep(std::chrono::nanoseconds duration) override { clock_.sleep(duration); }
  void forward(std::chrono::nanoseconds duration) { leap_ns_ += duration.count(); }

 private:
  std::chrono::nanoseconds leap() const { return std::chrono::nanoseconds(leap_ns_.load()); }
  mocks::ScaledClock clock_;
  std::atomic<std::int64_t> leap_ns_ = 0;
};

// A unit on the bench. Lock unit->mutex to read unit->unit.
struct BenchUnit {
  std::string serial;
  std::shared_ptr<LeapingClock> clock;
  std::shared_ptr<mocks::PluggedUnit> unit;
  std::shared_ptr<mocks::UsbUnit> device;
  std::string port;  // as the kernel names the socket; empty while it is not plugged in

  std::string hid_address() const { return "hid:" + serial; }
  std::string usb_address() const { return "usb:" + serial; }
};

// Different seeds are different units. The plan's time begins here.
inline BenchUnit make_unit(std::uint64_t seed, mocks::FaultPlan faults = {}, int pace = 1) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(seed);
  options.seed = seed;
  BenchUnit unit;
  unit.serial = options.truth.serial;
  unit.clock = std::make_shared<LeapingClock>(pace);
  unit.unit =
      std::make_shared<mocks::PluggedUnit>(std::move(options), std::move(faults), unit.clock);
  unit.device = std::make_shared<mocks::UsbUnit>(unit.unit);
  return unit;
}

class UsbBench {
 public:
  virtual ~UsbBench() = default;
  // Sets unit.port. Into `port` where one is named; the kernel takes its time to find it.
  virtual Status plug_in(BenchUnit& unit, const std::string& port = {}) = 0;
  // Pulls the cable; clears unit.port.
  virtual void unplug(BenchUnit& unit) = 0;
  // Waits until the unit's fault plan has taken it off the bus and the kernel has seen it; clears
  // unit.port. False when that does not happen within ten seconds. plug_in() then waits for the
  // plan to bring it back.
  virtual bool wait_until_left(BenchUnit& unit) = 0;
};

}  // namespace sixpoint::tests
