#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Jitter, HasItsSize) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 50, 20'000)});
  run.noise_mg = {5, 5, 5};
  run.effects = {spec("jitter", {{"rms_ms", {1}}})};
  const auto shaken = record_protocol(run);
  double power = 0;
  for (std::size_t i = 0; i < 20'000; ++i) {
    power += std::pow(shaken->sample_time_s[i] - 50 - static_cast<double>(i) / 100, 2);
  }
  EXPECT_NEAR(std::sqrt(power / 20'000), 0.001, 0.00003);
}

// Oracle: the moments of white Gaussian scatter of 0.5 ms; limits of five standard errors.
TEST(Jitter, EachTimeScattersByItself) {
  constexpr std::size_t kSamples = 40'000;
  const double n = kSamples;
  SimulatedBlock block = made_block(kSamples, 100, 200);
  const std::vector<double> nominal_s = block.time_s;
  made_effect("jitter", {{"rms_ms", {0.5}}})->on_sampling(block);
  double mean = 0;
  double square = 0;
  double fourth = 0;
  double lagged = 0;
  double before = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double z = (block.time_s[i] - nominal_s[i]) / 0.0005;  // in standard deviations
    mean += z / n;
    square += z * z / n;
    fourth += z * z * z * z / n;
    lagged += z * before / n;
    before = z;
  }
  EXPECT_NEAR(mean, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(square, 1, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(fourth, 3, 5 * std::sqrt(96 / n));
  EXPECT_NEAR(lagged, 0, 5 / std::sqrt(n));
}

}  // namespace
}  // namespace sixpoint::sim
