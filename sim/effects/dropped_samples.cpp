// Samples are lost, one by one, each with the same probability: the next ones come later than they
// should.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class DroppedSamples final : public RareSamples {
 public:
  using RareSamples::RareSamples;
  void on_sampling(SimulatedBlock& block) override {
    begin(block);
    for (double& time_s : block.time_s) {
      while (until_next_ == 0) {
        shift_s_ += interval_s_;
        draw();
      }
      --until_next_;
      time_s += shift_s_;
    }
  }
};

}  // namespace

EffectKind dropped_samples_kind() {
  return effect_kind("dropped_samples", Stage::sampling, "samples lost",
                     make_effect<DroppedSamples>, {RareSamples::rate()});
}

}  // namespace sixpoint::sim
