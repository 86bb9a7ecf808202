// While nothing moves the firmware sleeps and holds the last value, in runs of whole seconds. Runs
// stay within one rest; where they lie is drawn.
#include <algorithm>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind idle_sleep_kind() {
  return effect_kind(
      "idle_sleep", Stage::firmware, "holds the last value at rest",
      [](const ParameterSet& values, Random random) {
        auto made = std::make_unique<Parts>();
        auto runs = std::make_shared<SampleRuns>();
        made->recording = [runs, fraction = std::clamp(values.at("fraction")[0], 0.0, 1.0),
                           random](const RecordingPlan& plan) mutable {
          const double samples = fraction * static_cast<double>(plan.length());
          *runs = SampleRuns(draw_runs(plan, samples, true, random));
        };
        made->firmware = [runs, last = gt3x::Counts{}](SimulatedBlock& block) mutable {
          for (std::size_t i = 0; i < block.size(); ++i) {
            if (runs->contain(block.first_sample + i) && block.first_sample + i > 0) {
              block.stored[i] = last;
            }
            last = block.stored[i];
          }
        };
        return made;
      },
      {parameter("fraction", "1", {0.05}, 0, 0.9,
                 "share of all samples; runs of 1 s and more (vendor: idle sleep mode)")});
}

}  // namespace sixpoint::sim
