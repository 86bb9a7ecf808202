// Samples are lost, one by one, each with the same probability: the next ones come later than they
// should.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class DroppedSamples final : public Effect {
 public:
  DroppedSamples(const ParameterSet& values, Random random)
      : rate_(std::clamp(values.at("rate")[0], 0.0, 0.5)), random_(random), until_next_(draw()) {}
  void on_recording(const RecordingPlan& plan) override { interval_s_ = 1 / plan.rate_hz; }
  void on_sampling(SimulatedBlock& block) override {
    if (!started_ || block.clock_start_s != clock_start_s_) {
      started_ = true;
      clock_start_s_ = block.clock_start_s;
      shift_s_ = 0;
    }
    for (double& time_s : block.time_s) {
      while (until_next_ == 0) {
        shift_s_ += interval_s_;
        until_next_ = draw();
      }
      --until_next_;
      time_s += shift_s_;
    }
  }

 private:
  // Samples until the next one that is lost: geometric, 0 = the very next.
  std::uint64_t draw() {
    if (rate_ <= 0) {
      return ~std::uint64_t{0};
    }
    return static_cast<std::uint64_t>(
        std::min(1e15, std::floor(std::log(1 - random_.uniform()) / std::log(1 - rate_))));
  }

  double rate_;
  Random random_;
  std::uint64_t until_next_;
  double interval_s_ = 0.01;
  double clock_start_s_ = 0;
  double shift_s_ = 0;
  bool started_ = false;
};

}  // namespace

EffectKind dropped_samples_kind() {
  return {"dropped_samples",
          Stage::sampling,
          "samples lost",
          {{"rate",
            "1",
            {0.002},
            0,
            0.02,
            "share of samples; a full buffer or a slow flash: 1e-4 to 1e-2"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<DroppedSamples>(values, random);
          }};
}

}  // namespace sixpoint::sim
