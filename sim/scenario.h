// A scenario: which unit goes through which motion or which protocol, and what it records
// (docs/scenario.md).
//
//   SIXPOINT_ASSIGN(const Scenario scenario, parse_scenario(json));
//   SIXPOINT_ASSIGN(const auto report, write_recording(env.files, "unit.gt3x", scenario));
//
// The same scenario gives the same recording, byte for byte, on every machine.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/effects/effect.h"
#include "sim/effects/population.h"
#include "sim/motion.h"
#include "sim/protocol_run.h"
#include "sim/unit_truth.h"

namespace sixpoint::sim {

enum class MotionKind { still, shaker, free_living };

struct MotionSpec {
  MotionKind kind = MotionKind::still;
  double duration_s = 60;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // still and shaker
  Tone tone;                                               // shaker
  std::uint64_t seed = 0;                                  // free_living
};

struct Scenario {
  std::uint64_t seed = 1;
  UnitTruth unit;
  UtcTime start = from_unix_seconds(1'428'588'240);  // whole seconds
  int rate_hz = 30;
  bool wide = false;  // ACTIVITY2 records of 16 bits instead of ACTIVITY of 12
  // None: the one that the unit's firmware chooses. Else that one, against the header.
  std::optional<FilterConfiguration> filter;
  double temperature_c = 25;
  double gravity_g = 1;             // local gravity
  double turn_s = 2;                // from one motion to the next; 0 = no transition
  std::vector<MotionSpec> motions;  // empty where there is a protocol
  // A bundle instead of a plain recording; complete, with the scenario's effects and seed.
  std::optional<ProtocolRun> protocol;
  // What acts on this unit: what the scenario says, and what is drawn for it from the population.
  std::vector<EffectSpec> effects;
  std::vector<PopulationEffect> population;

  FilterConfiguration filter_in_force() const;
  // With the effects' answer to the shaker's tones.
  std::unique_ptr<MotionSequence> motion() const;
  // What the simulator's effects need to know of the motion.
  std::vector<Placement> placements() const;
  RecordingPlan plan() const;
};

// Strict: unknown keys, wrong types and impossible values are `configuration`, with the key's path.
Result<Scenario> parse_scenario(std::string_view json);

}  // namespace sixpoint::sim
