// A session that a virtual unit made: identified, constants read, streamed for a while.
#pragma once

#include "base/memory_env.h"
#include "device/session/session_recorder.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::tests {

inline device::Session made_session(int blocks = 20) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  device::Link link = mocks::link_to(
      std::make_shared<mocks::PluggedUnit>(options, std::make_shared<ManualClock>()), false);
  link.address = "virtual:seed=7";
  MemoryFiles files;
  device::SessionRecorder recorder;
  EXPECT_OK(recorder.begin(files, "made.zip"));
  recorder.attach(link);
  const auto unit = *device::WireUnit::open(std::move(link));
  EXPECT_OK(unit->read_calibration());
  EXPECT_OK(unit->start_stream(100));
  for (int i = 0; i < blocks; ++i) {
    EXPECT_OK(unit->next_samples(std::chrono::seconds(1)));
  }
  EXPECT_OK(unit->stop_stream());
  EXPECT_OK(recorder.finish());
  return *device::read_session(files, "made.zip");
}

}  // namespace sixpoint::tests
