#include "gap/features/lines.h"

#include <gtest/gtest.h>

#include "gap/features/settling.h"
#include "gap/features/timing.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(Lines, FrameIsTold) {
  const Eigen::Vector3d v(1.2e-3, -0.4e-3, 0.8e-3);
  for (const bool lab : {true, false}) {
    const Bundle bundle = tests::made_production({}, [&](const Segment& s, double t) {
      const Eigen::Vector3d line = std::cos(2 * M_PI * 17.3 * (s.host_start_s + t)) * v;
      return Eigen::Vector3d(s.rotation.col(2) + (lab ? Eigen::Vector3d(s.rotation * line) : line));
    });
    const CleanSamples clean = clean_samples(bundle);
    const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean)).lines;
    ASSERT_EQ(lines.size(), 1U);
    EXPECT_EQ(lines[0].in_lab, lab);
    EXPECT_TRUE(lines[0].decidable);
    EXPECT_NEAR(lines[0].frequency_hz, 17.3, 0.02);
    const double apart =
        std::min((lines[0].vector_mg - 1000 * v).norm(), (lines[0].vector_mg + 1000 * v).norm());
    EXPECT_LT(apart, 6 * lines[0].sd_mg);
  }
  const Bundle none = tests::made_production({});
  const CleanSamples clean = clean_samples(none);
  EXPECT_TRUE(find_lines(none, clean, noise_spectrum(none, clean)).lines.empty());
}

// What a unit records that loses a sample (steps > 0) or has one twice in some seconds of each
// dwell, and a strong line. The host stamps what it gets.
Bundle with_slips(double frequency_hz, const Eigen::Vector3d& line_g) {
  const auto lost_before = [](const Segment& s, double t) {
    const double first = s.placement % 3 + 0.37;
    return (t > first ? 1 : 0) + (t > 6.21 && s.placement % 2 == 0 ? 1 : 0) -
           (t > 8.55 && s.placement % 5 == 0 ? 1 : 0);
  };
  Bundle bundle = tests::made_production({}, [&](const Segment& s, double t) {
    const double clock_s = s.host_start_s + t + lost_before(s, t) / 100.0;
    return Eigen::Vector3d(s.rotation.col(2) +
                           std::cos(2 * M_PI * frequency_hz * clock_s) * line_g);
  });
  auto& clock = bundle.host_clock;
  for (std::size_t i = 0; i < clock.sample_index.size(); ++i) {
    const Segment& s = bundle.segments[clock.sample_index[i] / 1000];
    const double t = static_cast<double>(clock.sample_index[i] - s.first_sample) / 100;
    clock.host_time_s[i] += lost_before(s, t) / 100.0;
  }
  return bundle;
}

// At 26.8 Hz a sample is more than a quarter of a period.
TEST(Lines, LostSamplesDoNotSpreadALine) {
  const Eigen::Vector3d v(2e-3, 4e-3, -1e-3);
  const Bundle bundle = with_slips(26.8, v);
  CleanSamples clean = clean_samples(bundle);
  // How far off the line is, in standard deviations, and how much of it looks like ringing.
  const auto off_sd = [&](const SpectralLine& line) {
    return std::min((line.vector_mg - 1000 * v).norm(), (line.vector_mg + 1000 * v).norm()) /
           line.sd_mg;
  };
  const auto ringing_nats = [&](const SpectralLine& line) {
    return step_response(bundle, clean, noise_spectrum(bundle, clean), {line.frequency_hz})
        .gain_nats;
  };
  const auto spread = find_lines(bundle, clean, noise_spectrum(bundle, clean)).lines;
  ASSERT_FALSE(spread.empty());
  EXPECT_GT(off_sd(spread[0]), 10) << "samples stand where they are stored";
  EXPECT_GT(ringing_nats(spread[0]), 12);

  mark_slips(host_timing(bundle), clean);
  EXPECT_GT(clean.slips.size(), 18U);
  const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean)).lines;
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NEAR(lines[0].frequency_hz, 26.8, 0.02);
  EXPECT_FALSE(lines[0].in_lab);
  EXPECT_GT(lines[0].held_out_nats, 0);
  EXPECT_LT(off_sd(lines[0]), 6);
  EXPECT_LT(ringing_nats(lines[0]), 12) << "as without slips";
}

// A long record shows a line that drowns in each dwell (about one standard deviation there). What
// the dwells sum to in step with the host's clock shows its frame, also where the unit's clock is
// off by 1e-4.
TEST(Lines, PhaseByTheHostsClockShowsTheFrameOfASmallLine) {
  const Eigen::Vector3d v(0.15e-3, -0.08e-3, 0.12e-3);
  constexpr double kHost_hz = 17.3, kUnitClock = 1e-4;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const bool lab = seed % 2 == 0;
    const Bundle bundle = tests::made_production(
        {.seed = seed, .rounds = 3, .long_samples = 80'000}, [&](const Segment& s, double t) {
          const double host_s = s.host_start_s + t * (1 + kUnitClock);
          const Eigen::Vector3d line = std::cos(2 * M_PI * kHost_hz * host_s) * v;
          return Eigen::Vector3d(s.rotation.col(2) +
                                 (lab ? Eigen::Vector3d(s.rotation * line) : line));
        });
    const CleanSamples clean = clean_samples(bundle);
    const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean)).lines;
    ASSERT_EQ(lines.size(), 1U) << seed;
    EXPECT_EQ(lines[0].in_lab, lab) << seed;
    EXPECT_NEAR(lines[0].frequency_hz, kHost_hz * (1 + kUnitClock), 2e-3) << seed;
    EXPECT_NEAR(lines[0].vector_mg.norm(), 1000 * v.norm(), 6 * lines[0].sd_mg) << seed;
  }
}

// A line whose phase is another in each dwell, about twice a dwell's noise. Taking the likeliest
// phase of each dwell makes it a tenth larger.
TEST(Lines, NoiseDoesNotMakeASmallLineLarger) {
  const Eigen::Vector3d v(0.45e-3, -0.3e-3, 0.4e-3);
  double sum = 0;
  double square_sd = 0;
  constexpr int kSeeds = 12;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Bundle bundle = tests::made_production(
        {.seed = static_cast<unsigned>(seed)}, [&](const Segment& s, double t) {
          const double phase = 2.4 * s.placement * s.placement;
          return Eigen::Vector3d(s.rotation.col(2) + std::cos(2 * M_PI * 17.3 * t + phase) * v);
        });
    const CleanSamples clean = clean_samples(bundle);
    const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean)).lines;
    ASSERT_EQ(lines.size(), 1U) << seed;
    sum += lines[0].vector_mg.norm() / (1000 * v.norm());
    EXPECT_GT(lines[0].held_out_nats, 0) << "each half of the poses predicts the other: " << seed;
    square_sd += std::pow(lines[0].sd_mg / (1000 * v.norm()), 2);
  }
  EXPECT_NEAR(sum / kSeeds, 1, 3 * std::sqrt(square_sd) / kSeeds);
}

}  // namespace
}  // namespace sixpoint::gap
