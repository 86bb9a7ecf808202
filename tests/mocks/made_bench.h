// A virtual unit in a virtual jig, on a clock that the test moves, and the program's end of its
// cable.
#pragma once

#include <chrono>
#include <memory>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_jig.h"

namespace sixpoint::mocks {

struct Bench {
  explicit Bench(const char* firmware = "1.5.0", VirtualUnitOptions options = {}) {
    sim::GivenProperties given;
    given.firmware = firmware;
    options.truth = sim::draw_unit(7, given);
    clock = std::make_shared<ManualClock>();
    plugged = std::make_shared<PluggedUnit>(options, clock);
    jig = std::make_unique<VirtualJig>(plugged);
    unit = *device::WireUnit::open(link_to(plugged, false));
  }
  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<PluggedUnit> plugged;
  std::unique_ptr<VirtualJig> jig;
  std::unique_ptr<device::Unit> unit;
};

// The mean reading of a stream that runs.
inline PerAxis<double> mean_of_stream(Bench& bench, int reports) {
  PerAxis<double> sum{};
  double count = 0;
  for (int i = 0; i < reports; ++i) {
    const auto block = bench.unit->next_samples(std::chrono::seconds(1));
    if (!block || !block->has_value()) {
      ADD_FAILURE() << "the stream dried up";
      return {};
    }
    for (const auto& counts : (*block)->counts) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        sum[axis] += counts[axis];
      }
      ++count;
    }
  }
  return {sum[0] / count, sum[1] / count, sum[2] / count};
}

}  // namespace sixpoint::mocks
