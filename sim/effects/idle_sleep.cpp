// While nothing moves the firmware sleeps and holds the last value, in runs of whole seconds. Runs
// stay within one rest; where they lie is drawn.
#include <algorithm>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class IdleSleep final : public Effect {
 public:
  IdleSleep(const ParameterSet& values, Random random)
      : fraction_(std::clamp(values.at("fraction")[0], 0.0, 1.0)), random_(random) {}
  void on_recording(const RecordingPlan& plan) override {
    const double samples = fraction_ * static_cast<double>(plan.length());
    runs_ = SampleRuns(draw_runs("idle_sleep", plan, samples, true, random_));
  }
  Status problem() const override { return runs_.problem(); }
  void on_firmware(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (runs_.contain(block.first_sample + i) && block.first_sample + i > 0) {
        block.stored[i] = last_;
      }
      last_ = block.stored[i];
    }
  }

 private:
  double fraction_;
  Random random_;
  SampleRuns runs_;
  gt3x::Counts last_{};
};

}  // namespace

EffectKind idle_sleep_kind() {
  return effect_kind(
      "idle_sleep", Stage::firmware, "holds the last value at rest", make_effect<IdleSleep>,
      {parameter("fraction", "1", {0.05}, 0, 0.9,
                 "share of all samples; runs of 1 s and more (vendor: idle sleep mode)")});
}

}  // namespace sixpoint::sim
