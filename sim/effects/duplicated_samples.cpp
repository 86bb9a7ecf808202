// Samples are stored twice, one by one, each with the same probability: the next ones come earlier
// than they should. The copy is exact, noise and all.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class DuplicatedSamples final : public Effect {
 public:
  DuplicatedSamples(const ParameterSet& values, Random random)
      : rate_(std::clamp(values.at("rate")[0], 0.0, 0.5)), random_(random), until_next_(draw()) {}
  void on_recording(const RecordingPlan& plan) override { interval_s_ = 1 / plan.rate_hz; }
  void on_sampling(SimulatedBlock& block) override {
    if (!started_ || block.clock_start_s != clock_start_s_) {
      started_ = true;
      clock_start_s_ = block.clock_start_s;
      shift_s_ = 0;
    }
    repeats_.clear();
    for (std::size_t i = 0; i < block.size(); ++i) {
      // The first sample of a stretch has nothing to repeat.
      if (until_next_ == 0 && block.time_s[i] > block.clock_start_s) {
        repeats_.push_back(block.first_sample + i);
        shift_s_ -= interval_s_;
        until_next_ = draw();
      } else if (until_next_ > 0) {
        --until_next_;
      }
      block.time_s[i] += shift_s_;
    }
  }
  void on_firmware(SimulatedBlock& block) override {
    for (const std::uint64_t index : repeats_) {
      // A block may be a part of the one whose times were set.
      if (index >= block.first_sample && index < block.first_sample + block.size()) {
        const auto i = static_cast<std::size_t>(index - block.first_sample);
        block.stored[i] = i == 0 ? last_ : block.stored[i - 1];
      }
    }
    if (!block.stored.empty()) {
      last_ = block.stored.back();
    }
  }

 private:
  // Samples until the next one that is stored twice: geometric.
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
  std::vector<std::uint64_t> repeats_;
  gt3x::Counts last_{};
};

}  // namespace

EffectKind duplicated_samples_kind() {
  return {"duplicated_samples",
          Stage::sampling,
          "samples stored twice",
          {{"rate",
            "1",
            {0.002},
            0,
            0.02,
            "share of samples; a full buffer or a slow flash: 1e-4 to 1e-2"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<DuplicatedSamples>(values, random);
          }};
}

}  // namespace sixpoint::sim
