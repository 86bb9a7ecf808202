// Sample times scatter, each by itself.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Jitter final : public Effect {
 public:
  Jitter(const ParameterSet& values, Random random)
      : rms_s_(values.at("rms_ms")[0] / 1000), random_(random) {}
  void on_sampling(SimulatedBlock& block) override {
    for (double& time_s : block.time_s) {
      time_s += rms_s_ * random_.normal();
    }
  }

 private:
  double rms_s_;
  Random random_;
};

}  // namespace

EffectKind jitter_kind() {
  return {"jitter",
          Stage::sampling,
          "sample times scatter",
          {{"rms_ms", "ms", {0.7}, 0, 5, "interrupt latency of a small processor: 0.1 to 2 ms"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<Jitter>(values, random);
          }};
}

}  // namespace sixpoint::sim
