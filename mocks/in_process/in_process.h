// The in-process carrier: a virtual unit behind function calls, and the `virtual:` scheme.
//
//   auto plugged = std::make_shared<PluggedUnit>(VirtualUnitOptions{}, clock);
//   Result<std::unique_ptr<device::Unit>> unit = device::WireUnit::open(link_to(plugged, false));
//
// With pace=fast (the default) the link has a clock of its own: waiting moves it, so that six poses
// of ten seconds take milliseconds. With pace=real it is the machine's.
#pragma once

#include <memory>
#include <mutex>

#include "device/transport.h"
#include "mocks/faults/fault_injector.h"
#include "mocks/firmware/virtual_unit.h"

namespace sixpoint::mocks {

// The motor of the jig that turns a virtual unit. It outlives every link to the jig.
struct JigMotor {
  bool stopped = false;  // until released
  int movements = 0;
  // After a stop there are hands in the jig, until the test that stands for the operator calls
  // hands_out(). No message to the jig does that.
  bool hands_in = false;
  int movements_after_stop = 0;  // with hands in the jig: must stay 0

  void begin_movement() {
    ++movements;
    movements_after_stop += hands_in ? 1 : 0;
  }
  void stop() { stopped = hands_in = true; }
  void hands_out() { hands_in = false; }
};

// A virtual unit that is plugged in: shared by its two channels and its jig.
struct PluggedUnit {
  PluggedUnit(VirtualUnitOptions options, std::shared_ptr<Clock> link_clock)
      : clock(std::move(link_clock)), unit(std::move(options), clock->elapsed()) {}
  PluggedUnit(VirtualUnitOptions options, FaultPlan plan, std::shared_ptr<Clock> link_clock)
      : PluggedUnit(std::move(options), std::move(link_clock)) {
    faults = FaultInjector(std::move(plan), clock->elapsed());
  }

  std::shared_ptr<Clock> clock;
  std::mutex mutex;  // guards what follows
  VirtualUnit unit;
  FaultInjector faults;
  JigMotor motor;
  bool unplugged = false;  // every transfer answers device_unavailable
  bool cancelled = false;
};

// Channels (and, with `with_jig`, the jig) of a unit. The unit lives as long as any of them.
device::Link link_to(std::shared_ptr<PluggedUnit> plugged, bool with_jig);

// For what a device string leaves to chance: another one each time, so that a unit without a seed
// is another unit in every run of a program.
std::uint64_t fresh_seed(Env& env);

// Registers "virtual:".
void register_virtual(device::TransportRegistry& registry);

}  // namespace sixpoint::mocks
