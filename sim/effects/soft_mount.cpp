// The unit is held softly, by a strap or a pad, on the shaker: a resonance between base and unit.
// Transmissibility of a damped mass on a spring with a moving base (any vibration textbook):
// (1 + i r / Q) / (1 - r^2 + i r / Q) with r = f / f0.
#include <algorithm>
#include <cmath>
#include <complex>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class SoftMount final : public Effect {
 public:
  explicit SoftMount(const ParameterSet& values)
      : frequency_hz_(std::max(1e-3, values.at("frequency_hz")[0])),
        q_(std::max(1e-3, values.at("q")[0])) {}
  void on_tone(Tone& tone) const override {
    const double r = tone.frequency_hz / frequency_hz_;
    const std::complex<double> damping(0, r / q_);
    const std::complex<double> gain = (1.0 + damping) / (1.0 - r * r + damping);
    tone.amplitude_g *= std::abs(gain);
    tone.phase_rad += std::arg(gain);
  }

 private:
  double frequency_hz_;
  double q_;
};

}  // namespace

EffectKind soft_mount_kind() {
  return {"soft_mount",
          Stage::stimulus,
          "resonance of strap or mount on the shaker",
          {{"frequency_hz", "Hz", {15}, 1, 100, "a 20 g unit on a strap or a pad: 8 to 25 Hz"},
           {"q", "1", {2.5}, 0.5, 20, "rubber and textile: 1.5 to 4"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<SoftMount>(values);
          }};
}

}  // namespace sixpoint::sim
