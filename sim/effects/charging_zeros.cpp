// While it charges, the unit stores zero on all axes (paper, Step 2, third criterion).
// Either one stretch from `start_s` on, or up to six whose places are drawn.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class ChargingZeros final : public Effect {
 public:
  ChargingZeros(const ParameterSet& values, Random random)
      : start_s_(values.at("start_s")[0]),
        seconds_(std::max(0.0, values.at("seconds")[0])),
        random_(random) {}
  void on_recording(const RecordingPlan& plan) override {
    if (start_s_ < 0) {
      runs_ =
          SampleRuns(draw_runs("charging_zeros", plan, seconds_ * plan.rate_hz, false, random_));
    } else {
      runs_ = SampleRuns(std::vector{
          SampleRun{static_cast<std::uint64_t>(std::ceil(std::min(1e12, start_s_ * plan.rate_hz))),
                    static_cast<std::uint64_t>(
                        std::ceil(std::min(1e12, (start_s_ + seconds_) * plan.rate_hz)))}});
    }
  }
  Status problem() const override { return runs_.problem(); }
  void on_firmware(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (runs_.contain(block.first_sample + i)) {
        block.stored[i] = {};
      }
    }
  }

 private:
  double start_s_;
  double seconds_;
  Random random_;
  SampleRuns runs_;
};

}  // namespace

EffectKind charging_zeros_kind() {
  return effect_kind(
      "charging_zeros", Stage::firmware, "zero on all axes while the unit charges",
      make_effect<ChargingZeros>,
      {parameter("seconds", "s", {60}, 1, 1e5, "a charge takes up to two hours"),
       parameter("start_s", "s", {-1}, -1, 1e6, "of the recording, in stored time; -1 = drawn")});
}

}  // namespace sixpoint::sim
