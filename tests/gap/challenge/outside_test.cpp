// Effects outside the catalogue: does each do what its form says? The oracle is the form itself, in
// closed form. Nothing here diagnoses them: they have to stay blind.
#include "gap/challenge/outside.h"

#include <algorithm>
#include <array>
#include <set>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/challenge/made_rig.h"
#include "gap/challenge/trials.h"

namespace sixpoint::gap {
namespace {

using tests::kind_of;

constexpr std::array kServiced = {
    "stress_creep",     "bit_weight",        "channel_crosstalk",
    "beating_ripple",   "magnet_pull",       "cable_pull",
    "loose_battery",    "regulator_dropout", "torn_reads",
    "thermal_gradient", "wrong_pose",        "bit_errors",
    "self_calibration", "reference_noise",   "vibration_rectification",
    "transverse_shaker"};

TEST(OutsideKinds, ServicedOnesAreDrawnByNameOnly) {
  std::set<std::string> names;
  std::set<std::string_view> families;
  for (const sim::EffectKind& kind : sim::effect_catalogue()) {
    families.insert(family_of(kind.name));
  }
  for (const OutsideKind& kind : outside_kinds()) {
    EXPECT_TRUE(names.insert(kind.effect.name).second) << kind.effect.name;
    EXPECT_FALSE(static_cast<bool>(sim::find_effect(kind.effect.name))) << kind.effect.name;
    EXPECT_TRUE(kind.family.empty() || families.contains(kind.family)) << kind.effect.name;
    EXPECT_EQ(kind.only_by_name,
              std::find(kServiced.begin(), kServiced.end(), kind.effect.name) != kServiced.end())
        << kind.effect.name;
  }
  EXPECT_EQ(names.size(), 36 + kServiced.size());
  const std::vector<std::string> asked(kServiced.begin(), kServiced.end());
  std::set<std::string> seen;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const auto unasked = draw_trial(5, i, sim::StandardProtocol::engineering, {0, 0, 1});
    const auto named = draw_trial(5, i, sim::StandardProtocol::engineering, {0, 0, 1}, asked);
    ASSERT_OK(unasked);
    ASSERT_OK(named);
    EXPECT_FALSE(kind_of(unasked->effects[0].name).only_by_name);
    EXPECT_TRUE(kind_of(named->effects[0].name).only_by_name);
    seen.insert(named->effects[0].name);
  }
  EXPECT_EQ(seen.size(), kServiced.size());
}

// Both protocols, noise and all: severity zero is the nominal unit, the same seed the same
// recording, and what six faces can show is in the recording of six faces.
TEST(OutsideKinds, AProtocolRunHoldsWhatTheKindSays) {
  const auto counts = [](const OutsideKind& kind, std::uint64_t seed, double severity,
                         sim::StandardProtocol protocol) {
    sim::ProtocolRun run;
    run.segments = sim::draw_protocol(protocol, 11);
    run.temperature = sim::unit_temperature(run.segments, run.rate_hz);
    run.gain = {1.01, 0.99, 1.015};
    run.offset_g = {0.02, -0.03, 0.01};
    run.seed = seed;
    run.effects = {{&kind.effect, {{"severity", {severity}}}}};
    const auto made = sim::run_protocol(run);
    EXPECT_OK(made);
    return *made;
  };
  for (const char* name : kServiced) {
    const OutsideKind& kind = kind_of(name);
    const auto production = sim::StandardProtocol::production;
    const auto nothing = counts(kind, 3, 0, production);
    EXPECT_EQ(nothing, counts(kind_of("stress_creep"), 3, 0, production)) << name;
    EXPECT_EQ(counts(kind, 3, 1, production), counts(kind, 3, 1, production)) << name;
    int visible = 0;
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      visible += counts(kind, seed, 3, production) != counts(kind, seed, 0, production) ? 1 : 0;
    }
    if (kind.in_faces) {
      EXPECT_GE(visible, 5) << name;
    } else {
      const auto engineering = sim::StandardProtocol::engineering;
      EXPECT_NE(counts(kind, 3, 3, engineering), counts(kind, 3, 0, engineering)) << name;
    }
  }
}

}  // namespace
}  // namespace sixpoint::gap
