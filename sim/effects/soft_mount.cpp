// The unit is held softly, by a strap or a pad, on the shaker: a resonance between base and unit.
// Transmissibility of a damped mass on a spring with a moving base (any vibration textbook):
// (1 + i r / Q) / (1 - r^2 + i r / Q) with r = f / f0.
#include <algorithm>
#include <cmath>
#include <complex>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind soft_mount_kind() {
  return effect_kind(
      "soft_mount", Stage::stimulus, "resonance of strap or mount on the shaker",
      [](const ParameterSet& values, Random) {
        const double frequency_hz = std::max(1e-3, values.at("frequency_hz")[0]);
        const double q = std::max(1e-3, values.at("q")[0]);
        return acting_at(&Parts::tone, [frequency_hz, q](Tone& tone) {
          const double r = tone.frequency_hz / frequency_hz;
          const std::complex<double> damping(0, r / q);
          const std::complex<double> gain = (1.0 + damping) / (1.0 - r * r + damping);
          tone.amplitude_g *= std::abs(gain);
          tone.phase_rad += std::arg(gain);
        });
      },
      {parameter("frequency_hz", "Hz", {15}, 1, 100, "a 20 g unit on a strap or a pad: 8 to 25 Hz"),
       parameter("q", "1", {2.5}, 0.5, 20, "rubber and textile: 1.5 to 4")});
}

}  // namespace sixpoint::sim
