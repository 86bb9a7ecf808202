// A bundle of sim/, which shares no code with gap/, as its reader gets it.
#pragma once

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "gap/recording/bundle.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace sixpoint::tests {

// `protocol`: where its protocol.json goes.
inline Result<gap::Bundle> simulated(const nlohmann::ordered_json& scenario,
                                     nlohmann::ordered_json* protocol = nullptr) {
  MemoryEnv memory;
  SIXPOINT_ASSIGN(const sim::Scenario parsed, sim::parse_scenario(scenario.dump()));
  SIXPOINT_CHECK(sim::write_bundle(memory.files, "b", parsed));
  if (protocol != nullptr) {
    SIXPOINT_ASSIGN(const Bytes text, read_file(memory.files, "b/protocol.json"));
    *protocol = nlohmann::ordered_json::parse(text.begin(), text.end());
  }
  return gap::read_bundle(memory.files, "b");
}

}  // namespace sixpoint::tests
