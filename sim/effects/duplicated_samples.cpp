// Samples are stored twice, one by one, each with the same probability: the next ones come earlier
// than they should. The copy is exact, noise and all.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class DuplicatedSamples final : public RareSamples {
 public:
  using RareSamples::RareSamples;
  void on_sampling(SimulatedBlock& block) override {
    begin(block);
    repeats_.clear();
    for (std::size_t i = 0; i < block.size(); ++i) {
      // The first sample of a stretch has nothing to repeat.
      if (until_next_ == 0 && block.time_s[i] > block.clock_start_s) {
        repeats_.push_back(block.first_sample + i);
        shift_s_ -= interval_s_;
        draw();
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
  std::vector<std::uint64_t> repeats_;
  gt3x::Counts last_{};
};

}  // namespace

EffectKind duplicated_samples_kind() {
  return effect_kind("duplicated_samples", Stage::sampling, "samples stored twice",
                     make_effect<DuplicatedSamples>, {RareSamples::rate()});
}

}  // namespace sixpoint::sim
