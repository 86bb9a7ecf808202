#include "gap/features/timing.h"

#include <random>

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(HostTiming, ReadsRateAndSlipsExactly) {
  Bundle bundle = tests::made_production({});
  const HostTiming nominal = host_timing(bundle);
  EXPECT_NEAR(nominal.clock_ppm, 0, 4 * nominal.clock_sd_ppm);
  EXPECT_EQ(nominal.lost + nominal.repeated, 0U);
  // The square of a uniform variable has the variance 0.8 of its mean squared; the sd of a root is
  // half of that of its square. 18 lines through 10 stamps each share one slope.
  const double sd_ms = 2 / std::sqrt(3.0) * std::sqrt(0.8 / (180 - 18 - 1)) / 2;
  EXPECT_NEAR(nominal.scatter_ms, 2 / std::sqrt(3.0), 5 * sd_ms);

  // 3000 ppm fast, two samples lost in the third second of segment 4, one repeated in segment 9.
  for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
    const std::size_t segment = i / 10;
    const auto second = static_cast<double>(i % 10);
    double& t = bundle.host_clock.host_time_s[i];
    t += second * (1 / 1.003 - 1);
    t += segment == 4 && i % 10 >= 3 ? 0.02 : 0;
    t -= segment == 9 && i % 10 >= 7 ? 0.01 : 0;
  }
  const HostTiming timing = host_timing(bundle);
  EXPECT_NEAR(timing.clock_ppm, 3000, 5 * timing.clock_sd_ppm);
  EXPECT_EQ(timing.lost, 2U);
  EXPECT_EQ(timing.repeated, 1U);
  ASSERT_EQ(timing.slips.size(), 2U);
  EXPECT_EQ(timing.slips[0].first, 4200U);
  EXPECT_EQ(timing.slips[0].last, 4300U);
  EXPECT_EQ(timing.slips[0].lost, 2);
  EXPECT_EQ(timing.slips[1].first, 9600U);
  EXPECT_EQ(timing.slips[1].lost, -1);

  CleanSamples clean = clean_samples(bundle);
  clean.flags[4250] = clean.flags[4300] = kSampleWrapped;
  clean.wrapped_samples = 2;
  mark_slips(timing, clean);
  EXPECT_TRUE(clean.in_step(4199) && clean.in_step(4300));
  EXPECT_FALSE(clean.in_step(4200) || clean.in_step(4299));
  EXPECT_TRUE(clean.usable(4200)) << "its value is right";
  EXPECT_EQ(clean.wrapped_samples, 1U);
}

// A host's clock that is set by a year loses no 3e9 samples.
TEST(HostTiming, AClockThatIsSetIsBounded) {
  Bundle bundle = tests::made_production({});
  for (std::size_t i = 5; i < 10; ++i) {
    bundle.host_clock.host_time_s[i] += 3e7;
  }
  const HostTiming timing = host_timing(bundle);
  ASSERT_EQ(timing.slips.size(), 1U);
  EXPECT_EQ(timing.slips[0].lost, 1'000'000);
}

// Oracle: the slips that are put in. Stamps that jitter, 40,000 of them, a slip in every fiftieth
// second; all but the first and the last two, which have too few neighbours, are found.
TEST(HostTiming, ManySlipsAmongJitteringStampsAreFound) {
  constexpr std::size_t kSeconds = 40'000;
  Bundle bundle;
  Segment segment;
  segment.name = "still";
  segment.samples = 100 * kSeconds;
  bundle.segments = {segment};
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> stamp(-0.004, 0.004);
  double late_s = 0;
  for (std::size_t i = 0; i < kSeconds; ++i) {
    late_s += i % 50 == 25 ? (i % 100 == 25 ? 0.05 : -0.02) : 0;
    bundle.host_clock.sample_index.push_back(100 * i);
    bundle.host_clock.host_time_s.push_back(static_cast<double>(i) + late_s + stamp(random));
  }
  const HostTiming timing = host_timing(bundle);
  EXPECT_EQ(timing.lost, 400U * 5);
  EXPECT_EQ(timing.repeated, 400U * 2);
}

// Oracle: the rate and the slips that are put in. Where a clock is far off and slips in two of five
// seconds, each slip is 10 ms by the unit and less by the host.
TEST(HostTiming, AFastClockThatSlipsOftenHasItsRate) {
  constexpr std::size_t kSeconds = 1000;
  constexpr double kPpm = 3740;
  for (const int lost : {1, -1}) {
    Bundle bundle;
    Segment segment;
    segment.name = "still";
    segment.samples = 100 * kSeconds;
    bundle.segments = {segment};
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> stamp(-0.002, 0.002);
    double samples = 0;
    std::size_t slips = 0;
    for (std::size_t i = 0; i < kSeconds; ++i) {
      bundle.host_clock.sample_index.push_back(100 * i);
      if (i % 5 == 1 || i % 5 == 3) {
        samples += lost;
        ++slips;
      }
      bundle.host_clock.host_time_s.push_back(samples / 100 / (1 + 1e-6 * kPpm) + stamp(random));
      samples += 100;
    }
    const HostTiming timing = host_timing(bundle);
    EXPECT_NEAR(timing.clock_ppm, kPpm, 4 * timing.clock_sd_ppm);
    EXPECT_LT(timing.clock_sd_ppm, 1);
    EXPECT_EQ(lost > 0 ? timing.lost : timing.repeated, slips);
    EXPECT_EQ(timing.lost + timing.repeated, slips);
  }
}

TEST(HostTiming, NothingWithoutStamps) {
  Bundle bundle = tests::made_production({});
  bundle.host_clock = {};
  EXPECT_FALSE(host_timing(bundle).usable);
}

// Stamps that are exact: the rate is the slope to the digit.
TEST(HostTiming, ExactStampsGiveTheExactRate) {
  Bundle bundle = tests::made_production({});
  for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
    const Segment& segment = bundle.segments[i / 10];
    bundle.host_clock.host_time_s[i] =
        segment.host_start_s + static_cast<double>(i % 10) / 1.0005;  // 500 ppm fast
  }
  const HostTiming timing = host_timing(bundle);
  EXPECT_NEAR(timing.clock_ppm, 500, 1e-6);
  EXPECT_NEAR(timing.scatter_ms, 0, 1e-6);
  EXPECT_EQ(timing.packets, 18U * 9U);
  EXPECT_EQ(timing.samples, 18U * 900U);
}

}  // namespace
}  // namespace sixpoint::gap
