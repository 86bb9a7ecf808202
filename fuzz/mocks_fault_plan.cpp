// A fault plan, and a unit that it is carried out on: whatever the plan says, the station comes to
// an end.
#include "base/memory_env.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "mocks/faults/fault_plan.h"
#include "mocks/in_process/in_process.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  auto plan = mocks::parse_fault_plan({reinterpret_cast<const char*>(data), size});
  if (!plan) {
    return 0;
  }
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  const auto plugged = std::make_shared<mocks::PluggedUnit>(options, std::move(*plan),
                                                            std::make_shared<ManualClock>());
  auto unit = device::WireUnit::open(mocks::link_to(plugged, false));
  if (unit) {
    static_cast<void>((*unit)->read_calibration());
    static_cast<void>((*unit)->start_stream(100));
    for (int i = 0; i < 20; ++i) {
      static_cast<void>((*unit)->next_samples(std::chrono::milliseconds(200)));
    }
    static_cast<void>((*unit)->reconnect(std::chrono::seconds(1)));
  }
  return 0;
}
