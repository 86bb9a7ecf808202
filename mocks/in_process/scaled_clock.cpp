#include "mocks/in_process/scaled_clock.h"

#include "base/memory_env.h"
#include "device/transport.h"
#include "mocks/firmware/virtual_settings.h"

namespace sixpoint::mocks {

std::shared_ptr<Clock> clock_of(const VirtualSettings& settings, Clock& machine) {
  if (!settings.real_time) {
    return std::make_shared<ManualClock>(machine.now());
  }
  if (settings.pace > 1) {
    return std::make_shared<ScaledClock>(machine, settings.pace);
  }
  return device::borrow_clock(machine);
}

}  // namespace sixpoint::mocks
