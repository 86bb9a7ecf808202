#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"
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

// Two units with other gains and zeros: the recordings of both pile up at 6 x 256 counts, but for
// half a count of the sensor.
TEST(Saturation, ActsBehindGainAndZero) {
  for (const std::uint64_t seed : {1U, 2U}) {
    UnitTruth unit = draw_unit(seed);
    unit.firmware = "1.5.0";
    const NumberFormat format = format_with({6});
    Sensor sensor(unit, FilterConfiguration::current, Random(1, 1), format);
    FirmwareScaler firmware(unit, 16, format);
    const PerAxis<int> raw_lsb = sensor.read({7.9, -7.9, 1});
    const gt3x::Counts stored = firmware.store(raw_lsb);
    EXPECT_NEAR(stored[0], 1536, 1) << "unit " << seed;
    EXPECT_NEAR(stored[1], -1536, 1) << "unit " << seed;
    EXPECT_EQ(raw_lsb[2],
              Sensor(unit, FilterConfiguration::current, Random(1, 1)).read({7.9, -7.9, 1})[2])
        << "unit " << seed;
  }
}

// Oracle: a bundle of the same unit. Its sensor and its constants are of 256 LSB/g, so that both
// pile up at the level itself, on both sides.
TEST(Saturation, OneLevelIsOneCountInARecordingAndInABundle) {
  for (const double level_g : {1.5, 4.25, 6.0}) {
    const Tone shaken{Eigen::Vector3d(0, 0, 1), 2, 9, 0};
    const auto extremes = [](const std::vector<gt3x::Counts>& counts) {
      const auto [low, high] =
          std::ranges::minmax(counts, {}, [](const gt3x::Counts& sample) { return sample[2]; });
      return std::pair<int, int>(low[2], high[2]);
    };
    ProtocolRun bundle = tests::quiet({tests::tone(2, 9)});
    bundle.accel_scale_lsb_per_g = 256;
    bundle.effects = {tests::spec("saturation", {{"level_g", {level_g}}})};
    const auto made = run_protocol(bundle);
    ASSERT_OK(made);
    const int count = static_cast<int>(level_g * 256);
    EXPECT_EQ(extremes(*made), std::pair(-count, count));
    UnitTruth unit = tests::unit_of_256_lsb_per_g();
    const auto motion = shaker(Eigen::Matrix3d::Identity(), shaken);
    std::vector<std::unique_ptr<Effect>> effects;
    effects.push_back(made_effect("saturation", {{"level_g", {level_g}}}));
    Simulator simulator(unit, {}, *motion, std::move(effects));
    SimulatedBlock block;
    simulator.next(600, block);
    EXPECT_EQ(extremes(block.stored), std::pair(-count, count));
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
