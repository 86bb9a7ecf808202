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
  bool unplugged = false;  // every transfer answers device_unavailable
  bool cancelled = false;
};

// Channels (and, with `with_jig`, the jig) of a unit. The unit lives as long as any of them.
device::Link link_to(std::shared_ptr<PluggedUnit> plugged, bool with_jig);

// Registers "virtual:".
void register_virtual(device::TransportRegistry& registry);

}  // namespace sixpoint::mocks
