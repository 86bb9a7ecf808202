// A virtual unit on a virtual jig, for tests of a run and of a capture.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/wire_unit.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_jig.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

struct VirtualBench {
  explicit VirtualBench(std::uint64_t seed = 7, const sim::GivenProperties& given = {},
                        double temperature_c = mocks::VirtualUnitOptions{}.temperature_c) {
    mocks::VirtualUnitOptions options;
    options.seed = seed;
    options.truth = sim::draw_unit(seed, given);
    options.temperature_c = temperature_c;
    clock = std::make_shared<ManualClock>();
    plugged = std::make_shared<mocks::PluggedUnit>(options, clock);
    jig = std::make_unique<mocks::VirtualJig>(plugged);
    unit = *device::WireUnit::open(mocks::link_to(plugged, false));
  }
  Result<JigReport> run(JigSessionOptions options = {}) {
    JigHooks hooks;
    hooks.on_action = [this](const JigAction& action) {
      log.push_back(action);
      if (on_action) {
        on_action(action);
      }
    };
    auto report = run_jig(on_jig(), env.env, options, hooks);
    for (const std::string& code : report ? report->codes : std::vector<std::string>{}) {
      EXPECT_NE(find_failure_code(code), nullptr) << code << " is not in the catalogue";
    }
    return report;
  }
  UnitOnJig on_jig() { return {unit.get(), jig.get()}; }
  MemoryEnv env;
  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<mocks::PluggedUnit> plugged;
  std::unique_ptr<mocks::VirtualJig> jig;
  std::unique_ptr<device::Unit> unit;
  std::function<void(const JigAction&)> on_action;
  std::vector<JigAction> log;
};

}  // namespace sixpoint::station
