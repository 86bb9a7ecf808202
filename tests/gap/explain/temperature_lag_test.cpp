#include "gap/explain/temperature_lag.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

// Dwells of ten seconds, a minute apart, each at a commanded temperature.
Bundle commanded(const std::vector<double>& temperatures_c) {
  Bundle bundle;
  bundle.rate_hz = 100;
  for (const double temperature_c : temperatures_c) {
    Segment segment;
    segment.samples = 1000;
    segment.host_start_s = 25 + 60 * static_cast<double>(bundle.segments.size());
    segment.temperature_start_c = temperature_c;
    segment.temperature_end_c = temperature_c;
    bundle.segments.push_back(segment);
  }
  return bundle;
}

// Oracle: Newton's law of cooling. The chamber changes when the first dwell ends.
TEST(TemperatureLag, FollowsAsABodyOfOneTimeConstant) {
  const Bundle bundle = commanded({20, 30, 30, 30});
  const TemperatureLog log = following_temperature(bundle, 80);
  ASSERT_GT(log.host_time_s.size(), 15U);
  for (std::size_t i = 0; i < log.host_time_s.size(); ++i) {
    const double since_s = log.host_time_s[i] - 35;
    const double expected_c = since_s < 0 ? 20 : 30 - 10 * std::exp(-since_s / 80);
    EXPECT_NEAR(log.temperature_c[i], expected_c, 1e-9) << log.host_time_s[i];
  }
  EXPECT_EQ(following_temperature(bundle, 0).temperature_c.back(), 30);
}

// Zeros that follow the temperature of the unit, by 0.5 mg/C.
std::vector<Block> blocks_with_tempco(const Bundle& bundle, double lag_s, double mg_per_c) {
  Bundle unit;
  unit.temperature = following_temperature(bundle, lag_s);
  return tests::made_dwells([&](const Block& block) -> Eigen::Vector3d {
    return Eigen::Vector3d::Constant(mg_per_c * (unit.temperature_at(block.middle_s) - 25));
  });
}

TEST(TemperatureLag, IsFoundWhereTheZeroFollowsTemperature) {
  const Bundle bundle =
      commanded({25, 40, 40, 40, 10, 10, 10, 40, 40, 40, 40, 10, 10, 10, 10, 25, 25, 25});
  for (const double lag_s : {40.0, 120.0, 300.0}) {
    EXPECT_NEAR(likeliest_lag_s(bundle, blocks_with_tempco(bundle, lag_s, 0.5), {}) / lag_s, 1, 0.1)
        << lag_s;
  }
  EXPECT_EQ(likeliest_lag_s(bundle, blocks_with_tempco(bundle, 120, 0), {}), 0)
      << "nothing follows temperature";
  EXPECT_EQ(likeliest_lag_s(commanded(std::vector<double>(18, 23)),
                            blocks_with_tempco(bundle, 120, 0.5), {}),
            0)
      << "it was not changed";
  Bundle endless = bundle;
  endless.segments.back().host_start_s = 1e9;
  EXPECT_EQ(likeliest_lag_s(endless, blocks_with_tempco(bundle, 120, 0.5), {}), 0);
  EXPECT_LT(following_temperature(endless, 120).temperature_c.size(), 300'000U);
  Bundle logged = bundle;
  logged.temperature = following_temperature(bundle, 120);
  EXPECT_EQ(likeliest_lag_s(logged, blocks_with_tempco(bundle, 120, 0.5), {}), 0)
      << "the log says it";
}

}  // namespace
}  // namespace sixpoint::gap
