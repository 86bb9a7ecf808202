#include "gap/challenge/trials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

using gap::TrialKind;

TEST(Trials, SameSeedSameTrialAndEveryEffectComesUp) {
  std::set<std::string> seen;
  std::array<int, 4> kinds{};
  for (std::uint64_t i = 0; i < 400; ++i) {
    const auto trial = gap::draw_trial(7, i, sim::StandardProtocol::production, {});
    ASSERT_OK(trial);
    ++kinds[static_cast<std::size_t>(trial->kind)];
    const auto again = gap::draw_trial(7, i, sim::StandardProtocol::production, {});
    ASSERT_EQ(trial->effects.size(), again->effects.size());
    for (std::size_t k = 0; k < trial->effects.size(); ++k) {
      EXPECT_EQ(trial->effects[k].name, again->effects[k].name);
      EXPECT_GE(trial->effects[k].severity, 0.3);
      EXPECT_LE(trial->effects[k].severity, 3.0);
      seen.insert(trial->effects[k].name);
      EXPECT_EQ(static_cast<bool>(sim::find_effect(trial->effects[k].name)),
                trial->kind != TrialKind::outside);
    }
    EXPECT_EQ(trial->effects.empty(), trial->kind == TrialKind::none);
    if (i < 40) {
      EXPECT_EQ(*sim::run_protocol(*trial->scenario.protocol),
                *sim::run_protocol(*again->scenario.protocol));
    }
  }
  for (const sim::EffectKind& kind : sim::effect_catalogue()) {
    EXPECT_TRUE(seen.contains(kind.name)) << kind.name;
  }
  for (const int count : kinds) {
    EXPECT_GT(count, 30);
  }
}

constexpr auto kProduction = sim::StandardProtocol::production;

// Log-uniform from 0.3 to 3: the logarithm has the mean ln(0.9) / 2 and the sd ln(10) / sqrt(12).
TEST(Trials, SeverityIsLogUniform) {
  constexpr int kTrials = 600;
  double sum = 0;
  double square = 0;
  for (std::uint64_t i = 0; i < kTrials; ++i) {
    const auto trial = gap::draw_trial(11, i, kProduction, {0, 0, 0}, {"tilt"});
    ASSERT_OK(trial);
    ASSERT_EQ(trial->effects.size(), 1U);
    const double x = std::log(trial->effects[0].severity);
    sum += x / kTrials;
    square += x * x / kTrials;
  }
  const double sd = std::log(10) / std::sqrt(12);
  EXPECT_NEAR(sum, std::log(0.9) / 2, 4 * sd / std::sqrt(kTrials));
  EXPECT_NEAR(std::sqrt(square - sum * sum), sd, 0.05 * sd);
}

// Binomial: a share of trials within four standard deviations of what was asked for.
TEST(Trials, KindsComeInTheSharesAskedFor) {
  constexpr int kTrials = 1000;
  const gap::TrialShares shares{0.1, 0.3, 0.2};
  std::array<int, 4> kinds{};
  for (std::uint64_t i = 0; i < kTrials; ++i) {
    const auto trial = gap::draw_trial(12, i, kProduction, shares);
    ASSERT_OK(trial);
    ++kinds.at(static_cast<std::size_t>(trial->kind));
    if (trial->kind == TrialKind::pair) {
      ASSERT_EQ(trial->effects.size(), 2U);
      EXPECT_NE(trial->effects[0].name, trial->effects[1].name);
    }
  }
  const std::array<double, 4> wanted = {0.1, 0.4, 0.3, 0.2};  // none, single, pair, outside
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const double sd = std::sqrt(kTrials * wanted[k] * (1 - wanted[k]));
    EXPECT_NEAR(kinds[k], kTrials * wanted[k], 4 * sd) << gap::to_string(static_cast<TrialKind>(k));
  }
}

TEST(Trials, OnlyNamedEffectsAreDrawn) {
  std::set<std::string> seen;
  for (std::uint64_t i = 0; i < 100; ++i) {
    const auto trial =
        gap::draw_trial(13, i, kProduction, {0, 0.5, 0.3}, {"tilt", "drift", "magnet_pull"});
    ASSERT_OK(trial);
    for (const gap::TrialEffect& effect : trial->effects) {
      EXPECT_EQ(effect.name == "magnet_pull", trial->kind == TrialKind::outside);
      seen.insert(effect.name);
    }
  }
  EXPECT_EQ(seen, (std::set<std::string>{"drift", "magnet_pull", "tilt"}));
  // One name alone makes no pair.
  const auto alone = gap::draw_trial(13, 0, kProduction, {0, 1, 0}, {"tilt"});
  ASSERT_OK(alone);
  EXPECT_EQ(alone->kind, TrialKind::single);
}

// What the simulator gets has the size that the truth says: typical sizes of docs/gap.md times the
// severity. A slow drift bends as a warm-up of twelve hours, of the same slope at its start.
TEST(Trials, ParametersAreTheTypicalSizeTimesTheSeverity) {
  const auto largest = [](const std::vector<double>& numbers) {
    double most = 0;
    for (const double x : numbers) {
      most = std::max(most, std::abs(x));
    }
    return most;
  };
  std::set<std::string> drifts;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const auto seated = gap::draw_trial(14, i, kProduction, {0, 0, 0}, {"seating"});
    ASSERT_OK(seated);
    const auto& seat = seated->scenario.protocol->effects;
    ASSERT_EQ(seat.size(), 1U);
    EXPECT_NEAR(seat[0].values.at("sd_deg")[0], 0.1 * seated->effects[0].severity, 1e-12);
    const auto drifting = gap::draw_trial(14, i, kProduction, {0, 0, 0}, {"drift"});
    ASSERT_OK(drifting);
    const auto& drift = drifting->scenario.protocol->effects;
    ASSERT_EQ(drift.size(), 1U);
    const bool straight = drift[0].kind->name == "drift";
    const double mg_per_h =
        straight ? largest(drift[0].values.at("mg_per_h"))
                 : largest(drift[0].values.at("mg")) * 3600 / drift[0].values.at("tau_s")[0];
    EXPECT_NEAR(mg_per_h, 3 * drifting->effects[0].severity, 1e-9);
    EXPECT_EQ(drifting->effects[0].name, "drift");
    drifts.insert(drift[0].kind->name);
  }
  EXPECT_EQ(drifts, (std::set<std::string>{"drift", "warm_up"}));
}

// By hand: what one recording rarely tells apart, and kinds whose advice is a family's.
TEST(Trials, FamiliesByHand) {
  EXPECT_EQ(gap::family_of("tilt"), gap::family_of("misalignment"));
  EXPECT_EQ(gap::family_of("clock_error"), gap::family_of("half_rate"));
  EXPECT_EQ(gap::family_of("electrical_line"), gap::family_of("blower"));
  EXPECT_NE(gap::family_of("tilt"), gap::family_of("seating"));
  EXPECT_EQ(gap::family_of("settling"), "settling") << "a family of its own";
  EXPECT_EQ(gap::family_of("magnet_pull"), "magnet_pull") << "no advice is right but unknown";
}

TEST(Trials, KindsHaveNames) {
  EXPECT_EQ(gap::to_string(TrialKind::none), "none");
  EXPECT_EQ(gap::to_string(TrialKind::single), "single");
  EXPECT_EQ(gap::to_string(TrialKind::pair), "pair");
  EXPECT_EQ(gap::to_string(TrialKind::outside), "outside");
  EXPECT_EQ(gap::to_string(TrialKind::realistic), "realistic");
}

TEST(Trials, RealisticUnitsHaveManyEffectsAndOneThatDominates) {
  const gap::TrialShares shares{
      .none = 0, .pair = 0, .outside = 0, .realistic = 1, .any_rate = true};
  std::set<int> rates;
  bool all_ten = false;
  for (std::uint64_t i = 0; i < 60; ++i) {
    const auto trial = gap::draw_trial(77, i, kProduction, shares);
    ASSERT_OK(trial);
    EXPECT_EQ(trial->kind, TrialKind::realistic);
    ASSERT_GE(trial->effects.size(), 4U);
    EXPECT_LE(trial->effects.size(), 10U);
    std::set<std::string> names;
    for (std::size_t k = 0; k < trial->effects.size(); ++k) {
      EXPECT_TRUE(names.insert(trial->effects[k].name).second) << trial->effects[k].name;
      const bool clock = trial->effects[k].name == "clock_error";
      EXPECT_GE(trial->effects[k].severity, k == 0 ? 3 : clock ? 0.01 : 0.05);
      EXPECT_LE(trial->effects[k].severity, k == 0 ? 6 : 0.5);
    }
    all_ten = all_ten || trial->effects.size() == 10;
    rates.insert(static_cast<int>(trial->scenario.protocol->rate_hz));
  }
  EXPECT_TRUE(all_ten);
  EXPECT_GT(rates.size(), 7U);
}

TEST(Trials, FaintOnesAreGradualAndSmall) {
  const gap::TrialShares shares{.none = 0, .pair = 0.5, .outside = 0, .faint = true};
  const std::vector<std::string>& gradual = gap::gradual_effects();
  std::set<std::string> names;
  double least = 1;
  for (std::uint64_t i = 0; i < 120; ++i) {
    const auto trial = gap::draw_trial(78, i, kProduction, shares);
    ASSERT_OK(trial);
    EXPECT_EQ(trial->effects.size(), trial->kind == TrialKind::pair ? 2U : 1U);
    for (const gap::TrialEffect& effect : trial->effects) {
      EXPECT_NE(std::find(gradual.begin(), gradual.end(), effect.name), gradual.end())
          << effect.name;
      EXPECT_GE(effect.severity, 0.005);
      EXPECT_LE(effect.severity, 0.3);
      names.insert(effect.name);
      least = std::min(least, effect.severity);
    }
  }
  EXPECT_EQ(names.size(), gradual.size());
  EXPECT_LT(least, 0.01);
  const auto wraps = gap::draw_trial(78, 1, kProduction, shares, {"wrap"});
  ASSERT_FALSE(wraps.has_value());
  EXPECT_EQ(wraps.error().code, ErrorCode::usage);
}

}  // namespace
}  // namespace sixpoint
