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
    runs_ = draw_runs(plan, fraction_ * static_cast<double>(plan.length()), true, random_);
    next_ = 0;
  }
  void on_firmware(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const std::uint64_t index = block.first_sample + i;
      while (next_ < runs_.size() && index >= runs_[next_].end) {
        ++next_;
      }
      if (next_ < runs_.size() && index >= runs_[next_].begin && index > 0) {
        block.stored[i] = last_;
      }
      last_ = block.stored[i];
    }
  }

 private:
  double fraction_;
  Random random_;
  std::vector<SampleRun> runs_;
  std::size_t next_ = 0;
  gt3x::Counts last_{};
};

}  // namespace

EffectKind idle_sleep_kind() {
  return {"idle_sleep",
          Stage::firmware,
          "holds the last value at rest",
          {{"fraction",
            "1",
            {0.05},
            0,
            0.9,
            "share of all samples; runs of 1 s and more (vendor: idle sleep mode)"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<IdleSleep>(values, random);
          }};
}

}  // namespace sixpoint::sim
