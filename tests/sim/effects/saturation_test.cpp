#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/sensor.h"

namespace sixpoint::sim {
namespace {

using tests::made_effect;

NumberFormat format_with(const std::vector<double>& levels_g) {
  NumberFormat format;
  for (const double level_g : levels_g) {
    made_effect("saturation", {{"level_g", {level_g}}})->on_digital(format);
  }
  return format;
}

// Oracle: clipping, by hand.
TEST(Saturation, ClipsOnBothSides) {
  const NumberFormat format = format_with({6});
  EXPECT_EQ(format.limited(7), 6);
  EXPECT_EQ(format.limited(-6.1), -6);
  EXPECT_EQ(format.limited(5.9), 5.9);
  EXPECT_EQ(format_with({7, 6, 6.5}).limited(9), 6) << "the lowest level counts";
  EXPECT_EQ(format_with({}).limited(9), 9);
}

// Of two units with other gains and zeros both clip at the same count: 6 g of a nominal sensor.
TEST(Saturation, ActsBehindGainAndZero) {
  for (const std::uint64_t seed : {1U, 2U}) {
    UnitTruth unit = draw_unit(seed);
    Sensor sensor(unit, FilterConfiguration::current, Random(1, 1), format_with({6}));
    const PerAxis<int> raw_lsb = sensor.read({7.9, -7.9, 1});
    EXPECT_EQ(raw_lsb[0], 1500) << "unit " << seed;
    EXPECT_EQ(raw_lsb[1], -1500) << "unit " << seed;
    EXPECT_EQ(raw_lsb[2],
              Sensor(unit, FilterConfiguration::current, Random(1, 1)).read({7.9, -7.9, 1})[2])
        << "unit " << seed;
  }
}

// Oracle: a sine of 11 g is above 6 g in 1 - (2 / pi) asin(6 / 11) = 63.3 % of its period.
TEST(Saturation, TheShareOfAToneThatIsCut) {
  constexpr std::size_t kSamples = 100'000;
  const NumberFormat format = format_with({6});
  double cut = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double phase = 2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / kSamples;
    cut += std::abs(format.limited(11 * std::sin(phase))) == 6 ? 1 : 0;
  }
  EXPECT_NEAR(cut / kSamples, 1 - 2 / std::numbers::pi * std::asin(6.0 / 11), 1e-4);
}

}  // namespace
}  // namespace sixpoint::sim
