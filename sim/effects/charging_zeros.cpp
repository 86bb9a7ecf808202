// While it charges, the unit stores zero on all axes (paper, Step 2, third criterion).
// Either one stretch from `start_s` on, or up to three whose places are drawn.
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
    next_ = 0;
    if (start_s_ < 0) {
      runs_ = draw_runs(plan, seconds_ * plan.rate_hz, false, random_);
    } else {
      runs_ = {{static_cast<std::uint64_t>(std::ceil(std::min(1e12, start_s_ * plan.rate_hz))),
                static_cast<std::uint64_t>(
                    std::ceil(std::min(1e12, (start_s_ + seconds_) * plan.rate_hz)))}};
    }
  }
  void on_firmware(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const std::uint64_t index = block.first_sample + i;
      while (next_ < runs_.size() && index >= runs_[next_].end) {
        ++next_;
      }
      if (next_ < runs_.size() && index >= runs_[next_].begin) {
        block.stored[i] = {};
      }
    }
  }

 private:
  double start_s_;
  double seconds_;
  Random random_;
  std::vector<SampleRun> runs_;
  std::size_t next_ = 0;
};

}  // namespace

EffectKind charging_zeros_kind() {
  return {"charging_zeros",
          Stage::firmware,
          "zero on all axes while the unit charges",
          {{"seconds", "s", {60}, 1, 1e5, "a charge takes up to two hours"},
           {"start_s", "s", {-1}, -1, 1e6, "of the recording, in stored time; -1 = drawn"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<ChargingZeros>(values, random);
          }};
}

}  // namespace sixpoint::sim
