#include "sim/effects/population.h"

#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::sim {
namespace {

PopulationEffect effect(const char* name, const ParameterSet& mean, const ParameterSet& spread,
                        double share = 1) {
  const auto kind = find_effect(name);
  EXPECT_OK(kind);
  const auto complete = complete_parameters(**kind, mean);
  EXPECT_OK(complete);
  PopulationEffect out{*kind, *complete, *complete, share};
  for (auto& [key, numbers] : out.spread) {
    const auto given = spread.find(key);
    numbers = given == spread.end() ? std::vector<double>(numbers.size(), 0) : given->second;
  }
  return out;
}

// Oracle: the moments that were asked for; five standard errors of 4000 draws.
TEST(Population, UnitsHaveItsMeanAndSpread) {
  const std::vector<PopulationEffect> population = {
      effect("drift", {{"mg_per_h", {2, -1, 0}}}, {{"mg_per_h", {0.5, 0.1, 0}}})};
  double sum = 0, square = 0;
  constexpr int kUnits = 4000;
  for (std::uint64_t unit = 0; unit < kUnits; ++unit) {
    const auto drawn = draw_effects(population, unit);
    ASSERT_EQ(drawn.size(), 1U);
    const auto& numbers = drawn[0].values.at("mg_per_h");
    sum += numbers[0];
    square += (numbers[0] - 2) * (numbers[0] - 2);
    EXPECT_EQ(numbers[2], 0) << "no spread";
  }
  EXPECT_NEAR(sum / kUnits, 2, 5 * 0.5 / std::sqrt(kUnits));
  EXPECT_NEAR(std::sqrt(square / kUnits), 0.5, 5 * 0.5 / std::sqrt(2.0 * kUnits));
}

TEST(Population, WhatSomeUnitsHaveIsThereForThatShare) {
  const std::vector<PopulationEffect> some = {effect("wrap", {}, {}, 0.3)};
  int there = 0;
  for (std::uint64_t unit = 0; unit < 2000; ++unit) {
    there += static_cast<int>(draw_effects(some, unit).size());
  }
  EXPECT_NEAR(there / 2000.0, 0.3, 0.05);
  EXPECT_TRUE(mean_effects(some).empty());
  EXPECT_EQ(mean_effects({effect("wrap", {}, {}, 0.6)}).size(), 1U);
}

TEST(Population, SizesWithoutASignStayInTheirRange) {
  const std::vector<PopulationEffect> wide = {
      effect("seating", {{"sd_deg", {0.05}}}, {{"sd_deg", {1}}})};
  for (std::uint64_t unit = 0; unit < 200; ++unit) {
    const double sd_deg = draw_effects(wide, unit)[0].values.at("sd_deg")[0];
    EXPECT_GE(sd_deg, 0);
    EXPECT_LE(sd_deg, 0.5);
  }
}

TEST(Population, OneEffectDoesNotChangeAnother) {
  const auto drift = effect("drift", {}, {{"mg_per_h", {1, 1, 1}}});
  const auto tilt = effect("tilt", {}, {{"rotation_vector_deg", {0.1, 0.1, 0}}});
  const auto alone = draw_effects({drift}, 9);
  const auto beside = draw_effects({tilt, drift}, 9);
  EXPECT_EQ(alone[0].values, beside[1].values);
  EXPECT_NE(draw_effects({drift}, 10)[0].values, alone[0].values);
  EXPECT_EQ(mean_effects({drift})[0].values.at("mg_per_h"), drift.mean.at("mg_per_h"));
}

}  // namespace
}  // namespace sixpoint::sim
