// The whole chain from motion to stored counts, block by block.
//
//   const auto motion = still(rotation_with_up({0, 0, 1}));
//   Simulator simulator(draw_unit(7), SimulatorOptions{}, *motion);
//   SimulatedBlock block;
//   simulator.next(30, block);  // block.stored holds a second
#pragma once

#include <memory>
#include <vector>

#include "sim/effects/effect.h"
#include "sim/firmware.h"
#include "sim/motion.h"
#include "sim/sensor.h"
#include "sim/unit_truth.h"

namespace sixpoint::sim {

struct SimulatorOptions {
  double rate_hz = 30;
  FilterConfiguration filter = FilterConfiguration::current;  // that the sensor runs under
  int stored_bits = 12;
  double start_s = 0;  // of the first sample on the motion's time scale
  double temperature_c = 25;
  std::uint64_t seed = 1;  // of noise and random effects
  // What effects with history need to know; times on the motion's time scale. Empty: the unit lies
  // in its first pose from the start.
  RecordingPlan plan;                 // its rate is not read: rate_hz above holds
  std::vector<Placement> placements;  // in the order of time
};

// Placements divide blocks for the effects, not for the caller. What the shaker does to the unit
// (Effect::on_tone) belongs to the motion: Scenario::motion() asks the effects for it.
//
// One object belongs to one thread. `motion` must outlive it.
class Simulator {
 public:
  Simulator(const UnitTruth& unit, const SimulatorOptions& options, Motion& motion,
            std::vector<std::unique_ptr<Effect>> effects = {});

  // configuration where an effect has no room in the recording: next() goes on without it.
  Status problem() const { return check_effects(effects_); }
  // The next `samples`; `block` is overwritten; its memory is used again.
  void next(std::size_t samples, SimulatedBlock& block);
  std::uint64_t samples() const { return done_; }
  std::uint64_t clipped() const { return firmware_.clipped(); }
  // True time of sample `index` by the nominal clock, on the motion's time scale.
  double nominal_time_s(std::uint64_t index) const {
    return options_.start_s + static_cast<double>(index) / options_.rate_hz;
  }

 private:
  // The block's samples have their times; everything else follows.
  void make(SimulatedBlock& block);

  SimulatorOptions options_;
  Motion& motion_;
  std::vector<std::unique_ptr<Effect>> effects_;
  Sensor sensor_;
  FirmwareScaler firmware_;
  std::uint64_t done_ = 0;
  std::size_t next_placement_ = 0;
  SimulatedBlock part_;
};

}  // namespace sixpoint::sim
