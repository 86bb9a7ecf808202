#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(SoftMount, ResonatesAtItsFrequency) {
  ProtocolRun run = quiet({tone(10, 0.1)});
  EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100, 0.3);
  run.effects = {spec("soft_mount", {{"frequency_hz", {10}}, {"q", {3}}})};
  EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100 * std::sqrt(1.0 + 9), 0.5);
}

Tone behind_the_mount(double frequency_hz, double q) {
  Tone shaken;
  shaken.frequency_hz = frequency_hz;
  shaken.amplitude_g = 1;
  shaken.phase_rad = 0.2;
  made_effect("soft_mount", {{"frequency_hz", {10}}, {"q", {q}}})->on_tone(shaken);
  return shaken;
}

// Oracle: transmissibility in any vibration textbook: one far below the resonance; one at sqrt(2)
// times it, whatever the damping; less above; and towards Q / r where damping carries the force.
TEST(SoftMount, PassesSlowMotionAndHoldsBackFastMotion) {
  for (const double q : {1.0, 2.5, 4.0}) {
    EXPECT_NEAR(behind_the_mount(0.01, q).amplitude_g, 1, 1e-5) << q;
    EXPECT_NEAR(behind_the_mount(10 * std::numbers::sqrt2, q).amplitude_g, 1, 1e-12) << q;
    EXPECT_LT(behind_the_mount(20, q).amplitude_g, 1) << q;
    EXPECT_NEAR(behind_the_mount(1e5, q).amplitude_g * 1e4 * q, 1, 1e-3) << q;
  }
}

// Oracle: at the resonance the gain is (1 + i / Q) / (i / Q) = 1 - i Q.
TEST(SoftMount, LagsAtTheResonance) {
  for (const double q : {1.0, 2.5, 4.0}) {
    const Tone felt = behind_the_mount(10, q);
    EXPECT_NEAR(felt.amplitude_g, std::sqrt(1 + q * q), 1e-12);
    EXPECT_NEAR(felt.phase_rad, 0.2 - std::atan(q), 1e-12);
    EXPECT_EQ(felt.frequency_hz, 10);
  }
}

}  // namespace
}  // namespace sixpoint::sim
