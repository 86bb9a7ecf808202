// Effects outside the catalogue: does each do what its form says? The oracle is the form itself, in
// closed form. Nothing here diagnoses them: they have to stay blind.
#include "gap/challenge/outside.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/challenge/made_rig.h"
#include "gap/challenge/trials.h"

namespace sixpoint::gap {
namespace {

using tests::kForms;
using tests::kind_of;
using tests::kRate_hz;
using tests::pose;
using tests::Rig;
using tests::Vector3d;

// Which axes of the stored counts differ from those given.
std::vector<std::size_t> changed_axes(const std::vector<gt3x::Counts>& given,
                                      const std::vector<gt3x::Counts>& stored) {
  std::vector<std::size_t> axes;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (given[i][axis] != stored[i][axis]) {
        axes.push_back(axis);
        break;
      }
    }
  }
  return axes;
}

// Every count from -96 to 95 on all axes.
std::vector<gt3x::Counts> ramp() {
  std::vector<gt3x::Counts> counts;
  for (std::int16_t x = -96; x < 96; ++x) {
    counts.push_back({x, x, x});
  }
  return counts;
}

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

// 3 mg per axis and unit of severity, from a moment in the middle half on; nothing before it.
TEST(OutsideKinds, ZeroStepsOnceAndStays) {
  constexpr std::size_t kSamples = 1000;
  std::set<std::size_t> moments;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("zero_step", form, 2);
    rig.plan({kRate_hz, kSamples, {}});
    rig.place(pose({0, 0, 1}));
    rig.record(kSamples);
    std::size_t first = 0;
    while (first < kSamples && rig.change(first).norm() == 0) {
      ++first;
    }
    EXPECT_GE(first, kSamples / 4);
    EXPECT_LE(first, kSamples * 3 / 4);
    for (std::size_t i = first; i < kSamples; ++i) {
      ASSERT_LT((rig.change(i) - Vector3d(6e-3, -6e-3, 6e-3)).norm(), 1e-12);
    }
    moments.insert(first / 50);
  }
  EXPECT_GT(moments.size(), 4U);
}

// A gain acts in proportion: 1 g along an axis shows that axis' ratio, the largest of which is 0.3
// %.
TEST(OutsideKinds, GainStepIsInProportionToWhatIsSensed) {
  constexpr std::size_t kSamples = 1000;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    double most = 0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      Rig rig("gain_step", form);
      rig.plan({kRate_hz, kSamples, {}});
      rig.place(pose(Vector3d::Unit(axis)));
      rig.record(kSamples);
      EXPECT_EQ(rig.change(0).norm(), 0);
      const Vector3d after = rig.change(kSamples - 1);
      EXPECT_LT((after - after[axis] * Vector3d::Unit(axis)).norm(), 1e-12);
      most = std::max(most, std::abs(after[axis]));
    }
    EXPECT_NEAR(most, 3e-3, 1e-9);
  }
}

// A bit that is stuck: every second group of counts of one axis reads as its neighbour.
TEST(OutsideKinds, StuckBitsChangeOneAxisByTheirValue) {
  const auto given = ramp();
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig low("stuck_bit", form);
    low.place(pose({0, 0, 1}));
    const auto even = low.store(given);
    const auto low_axes = changed_axes(given, even);
    ASSERT_EQ(low_axes.size(), 1U);
    Rig high("stuck_high_bit", form);
    high.place(pose({0, 0, 1}));
    const auto set = high.store(given);
    const auto high_axes = changed_axes(given, set);
    ASSERT_EQ(high_axes.size(), 1U);
    std::set<int> added;
    for (std::size_t i = 0; i < given.size(); ++i) {
      const int x = given[i][0];
      EXPECT_EQ(even[i][low_axes[0]], x % 2 == 0 ? x : x - 1);
      added.insert(set[i][high_axes[0]] - x);
    }
    ASSERT_EQ(added.size(), 2U);
    EXPECT_EQ(*added.begin(), 0);
    const int bit = *added.rbegin();
    EXPECT_TRUE(bit == 2 || bit == 4 || bit == 8 || bit == 16) << bit;
    for (std::size_t i = 0; i < given.size(); ++i) {
      // -96 is a multiple of 32: counted from there, the lower half of each 2 x bit lacks the bit.
      const int lacks = static_cast<int>(i) % (2 * bit) < bit ? bit : 0;
      EXPECT_EQ(set[i][high_axes[0]], given[i][0] + lacks);
    }
  }
}

// One code in 4, 8, 16 or 32 of one axis is never given: its neighbour on one side gets it.
TEST(OutsideKinds, MissingCodesLieEquallyFarApart) {
  const auto given = ramp();
  std::set<std::size_t> periods;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("missing_codes", form);
    rig.place(pose({0, 0, 1}));
    const auto stored = rig.store(given);
    const auto axes = changed_axes(given, stored);
    ASSERT_EQ(axes.size(), 1U);
    std::vector<std::size_t> at;
    std::set<int> moves;
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (stored[i] != given[i]) {
        at.push_back(i);
        moves.insert(stored[i][axes[0]] - given[i][axes[0]]);
      }
    }
    ASSERT_EQ(moves.size(), 1U);
    EXPECT_EQ(std::abs(*moves.begin()), 1);
    const std::size_t period = given.size() / at.size();
    EXPECT_TRUE(period == 4 || period == 8 || period == 16 || period == 32) << period;
    for (std::size_t k = 1; k < at.size(); ++k) {
      EXPECT_EQ(at[k] - at[k - 1], period);
    }
    periods.insert(period);
  }
  EXPECT_EQ(periods.size(), 4U);
}

// Severity 0.5, 1 and 2: steps of 2, 4 and 8 counts, to the nearest.
TEST(OutsideKinds, CoarseStepsAreTheNearestMultiple) {
  const auto given = ramp();
  for (const auto& [severity, step] : {std::pair{0.5, 2}, std::pair{1.0, 4}, std::pair{2.0, 8}}) {
    Rig rig("coarse_steps", 1, severity);
    rig.place(pose({0, 0, 1}));
    const auto stored = rig.store(given);
    for (std::size_t i = 0; i < given.size(); ++i) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        EXPECT_EQ(stored[i][axis] % step, 0);
        EXPECT_LE(std::abs(stored[i][axis] - given[i][axis]), step / 2);
      }
    }
  }
}

TEST(OutsideKinds, DelayedAxisIsOneSampleLateAndHalfTheRateComesTwice) {
  const auto given = ramp();
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("delayed_axis", form);
    rig.place(pose({0, 0, 1}));
    const auto late = rig.store(given);
    const auto axes = changed_axes(given, late);
    ASSERT_EQ(axes.size(), 1U);
    for (std::size_t i = 1; i < given.size(); ++i) {
      EXPECT_EQ(late[i][axes[0]], given[i - 1][axes[0]]);
    }
  }
  Rig half("half_rate", 1);
  half.place(pose({0, 0, 1}));
  const auto twice = half.store(given);
  for (std::size_t i = 0; i < given.size(); ++i) {
    EXPECT_EQ(twice[i], given[i - i % 2]);
  }
}

// 2 mg at the moment of placement, then an exponential of one time constant: x(2t) x(0) = x(t)^2.
TEST(OutsideKinds, HandWarmthDecaysFromEachPlacementOn) {
  constexpr std::size_t kLater = 500;
  std::set<int> constants_s;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("hand_warmth", form);
    rig.place(pose({0, 0, 1}));
    rig.record(2 * kLater + 1);
    const Vector3d first = rig.change(0);
    EXPECT_NEAR(first.cwiseAbs().maxCoeff(), 2e-3, 1e-9);
    const double share = rig.change(kLater).norm() / first.norm();
    EXPECT_NEAR(rig.change(2 * kLater).norm() / first.norm(), share * share, 1e-9);
    const double tau_s = -static_cast<double>(kLater) / kRate_hz / std::log(share);
    EXPECT_GE(tau_s, 4 - 1e-6);
    EXPECT_LE(tau_s, 40 + 1e-6);
    constants_s.insert(static_cast<int>(tau_s));
    rig.place(pose({0, 0, -1}));
    EXPECT_LT((rig.change_here() - first).norm(), 1e-9);
  }
  EXPECT_GT(constants_s.size(), 8U);
}

// One axis clips, on one side, between 3.5 and 7 g: a tone of 9 g about 1 g reaches -8 and 10 g.
TEST(OutsideKinds, OneSideOfOneAxisClips) {
  std::array<int, 2> sides{};
  for (std::uint64_t form = 0; form < kForms; ++form) {
    int clipped = 0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      Rig rig("one_sided_clip", form);
      rig.place(pose(Vector3d::Unit(axis)));
      const auto& block = rig.record(200, 9, 5);
      double low = 0;
      double high = 0;
      for (const Vector3d& sensed : block.sensed_g) {
        low = std::min(low, sensed[axis]);
        high = std::max(high, sensed[axis]);
      }
      const bool cut_high = high < 9.9;
      const bool cut_low = low > -7.9;
      EXPECT_FALSE(cut_high && cut_low);
      if (cut_high || cut_low) {
        ++clipped;
        ++sides.at(cut_high ? 1 : 0);
        const double level_g = cut_high ? high : -low;
        EXPECT_GE(level_g, 3.5);
        EXPECT_LE(level_g, 7);
      }
    }
    EXPECT_EQ(clipped, 1);
  }
  EXPECT_GT(sides[0], 4);
  EXPECT_GT(sides[1], 4);
}

// Play of 3 mg either way: of a tone of 10 mg 14 mg are left from peak to peak, of one of 2 mg
// nothing.
TEST(OutsideKinds, DeadZoneTakesItsWidthOffEveryReversal) {
  const auto peak_to_peak_mg = [](double tone_mg) {
    Rig rig("dead_zone", 1);
    rig.place(pose({0, 0, 1}));
    const auto& block = rig.record(400, tone_mg / 1000, 1);
    double low = 9;
    double high = -9;
    for (std::size_t i = 200; i < 400; ++i) {  // from the third period on
      low = std::min(low, block.sensed_g[i].z());
      high = std::max(high, block.sensed_g[i].z());
    }
    return 1000 * (high - low);
  };
  EXPECT_NEAR(peak_to_peak_mg(10), 14, 1e-6);
  EXPECT_NEAR(peak_to_peak_mg(2), 0, 1e-6);
}

// 2 % for each decade of frequency from 2 Hz on, level below 0.1 Hz.
TEST(OutsideKinds, RateGainGoesWithTheLogarithmOfTheFrequency) {
  std::set<double> signs;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    const Rig rig("rate_gain", form);
    EXPECT_NEAR(rig.tone(2).amplitude_g, 1, 1e-12);
    const double decade = rig.tone(20).amplitude_g - 1;
    EXPECT_NEAR(std::abs(decade), 0.02, 1e-12);
    EXPECT_NEAR(rig.tone(0.2).amplitude_g - 1, -decade, 1e-12);
    EXPECT_EQ(rig.tone(0.05).amplitude_g, rig.tone(0.1).amplitude_g);
    signs.insert(decade > 0 ? 1 : -1);
  }
  EXPECT_EQ(signs.size(), 2U);
}

}  // namespace
}  // namespace sixpoint::gap
