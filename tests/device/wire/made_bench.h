// A virtual unit with a clock that the test moves, and a link to it that a test may tamper with.
#pragma once

#include <memory>
#include <utility>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/unit.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"
#include "mocks/inert/inert.h"

namespace sixpoint::tests {

struct Bench {
  Bench() {
    mocks::VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    clock = std::make_shared<ManualClock>();
    plugged = std::make_shared<mocks::PluggedUnit>(options, clock);
  }
  device::Link link() { return mocks::link_to(plugged, false); }
  device::Link tampered(mocks::TamperingTransport::Tamper on_write,
                        mocks::TamperingTransport::Tamper on_read) {
    device::Link result = link();
    result.reports = std::make_unique<mocks::TamperingTransport>(
        std::move(result.reports), std::move(on_write), std::move(on_read));
    return result;
  }
  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<mocks::PluggedUnit> plugged;
};

// A recording of that length, which takes the bench no time: its entry in the unit's list.
inline device::RecordingInfo record(Bench& bench, device::Unit& unit, int recording_s) {
  const auto id = unit.start_recording(100, from_unix_seconds(1'500'000'000));
  EXPECT_OK(id);
  bench.clock->sleep(std::chrono::seconds(recording_s));
  EXPECT_OK(unit.stop_recording());
  const auto list = unit.recordings();
  EXPECT_OK(list);
  return list->back();
}

}  // namespace sixpoint::tests
