// A scenario, and the first seconds of what it describes.
#include <string_view>

#include "sim/scenario.h"
#include "sim/simulator.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const auto scenario = sim::parse_scenario({reinterpret_cast<const char*>(data), size});
  if (!scenario) {
    return 0;
  }
  static_cast<void>(scenario->plan());
  const auto motion = scenario->motion();
  sim::SimulatorOptions options;
  options.rate_hz = scenario->rate_hz;
  options.filter = scenario->filter_in_force();
  options.temperature_c = scenario->temperature_c;
  options.seed = scenario->seed;
  options.placements = scenario->placements();
  sim::Simulator simulator(scenario->unit, options, *motion);
  sim::SimulatedBlock block;
  simulator.next(300, block);
  return 0;
}
