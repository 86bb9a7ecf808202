#include "gap/recording/clean.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(Clean, TurnedAxesAreFoundAndTurnedBack) {
  const Bundle right = tests::made_production({});
  for (const auto& rows : {std::array<int, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1},
                           std::array<int, 9>{0, 1, 0, 0, 0, -1, -1, 0, 0},
                           std::array<int, 9>{-1, 0, 0, 0, 1, 0, 0, 0, 1}}) {
    const Eigen::Matrix3i m =
        Eigen::Map<const Eigen::Matrix<int, 3, 3, Eigen::RowMajor>>(rows.data());
    Bundle turned = right;
    for (gt3x::Counts& x : turned.samples) {
      const Eigen::Vector3i stored = m * Eigen::Vector3i(x[0], x[1], x[2]);
      for (std::size_t a = 0; a < 3; ++a) {
        x[a] = static_cast<std::int16_t>(stored[static_cast<Eigen::Index>(a)]);
      }
    }
    const CleanSamples clean = clean_samples(turned);
    EXPECT_TRUE(clean.axes_turned);
    EXPECT_EQ(clean.axis_matrix, m);
    EXPECT_EQ(clean.samples, right.samples);
  }
  EXPECT_FALSE(clean_samples(right).axes_turned);
  EXPECT_TRUE(clean_samples(right).axes_decidable);
}

// The table of axes_turned. Of one pose that is not the protocol's many permutations fit alike: none is
// known, and nothing is turned.
TEST(Clean, AxesThatOnePoseLeavesOpenAreLeftAsTheyAre) {
  Bundle one = tests::made_production({});
  const auto up_z = std::ranges::find_if(
      one.segments, [](const Segment& segment) { return segment.rotation.col(2)[2] > 0.9; });
  ASSERT_NE(up_z, one.segments.end());
  one.segments = {*up_z};
  EXPECT_FALSE(clean_samples(one).axes_decidable);
  EXPECT_FALSE(clean_samples(one).axes_turned);
  for (gt3x::Counts& counts : one.samples) {
    counts[2] = static_cast<std::int16_t>(-counts[2]);
  }
  const CleanSamples upside_down = clean_samples(one);
  EXPECT_FALSE(upside_down.axes_decidable);
  EXPECT_FALSE(upside_down.axes_turned);
  EXPECT_EQ(upside_down.samples, one.samples);
  EXPECT_NEAR(upside_down.pose_error_g, 2, 0.1) << "it lies upside down";
}

TEST(Clean, ZerosAndHoldsAreMaskedToTheSample) {
  Bundle bundle = tests::made_production({});
  std::fill(bundle.samples.begin() + 2500, bundle.samples.begin() + 2800, gt3x::Counts{});
  std::fill(bundle.samples.begin() + 7000, bundle.samples.begin() + 7150, bundle.samples[7000]);
  const CleanSamples clean = clean_samples(bundle);
  EXPECT_EQ(clean.zeros.samples, 300U);
  EXPECT_EQ(clean.zeros.segments, (std::vector<std::size_t>{2}));
  EXPECT_EQ(clean.held.runs, 1U);
  EXPECT_NEAR(static_cast<double>(clean.held.samples), 150, 3)
      << "a neighbour may be equal by chance";
  EXPECT_EQ(clean.flags[2499], kSampleGood);
  EXPECT_EQ(clean.flags[2500], kSampleZero);
}

TEST(Clean, NominalRecordingHasNoMarks) {
  const CleanSamples clean = clean_samples(tests::made_production({}));
  EXPECT_EQ(clean.zeros.runs + clean.held.runs + clean.stuck.runs, 0U);
  EXPECT_FALSE(clean.saturated);
  EXPECT_EQ(clean.wrapped_samples, 0U);
}

// A tone of 11 g along Z behind the six faces.
Bundle with_high_tone(double limit_g, bool wraps) {
  Bundle bundle = tests::made_production({});
  Segment tone;
  tone.name = "shaker_high";
  tone.kind = Segment::Kind::vibration;
  tone.first_sample = bundle.samples.size();
  tone.samples = 500;
  tone.host_start_s = 1000;
  tone.placement = 99;
  tone.vibration = Vibration{Eigen::Vector3d::UnitZ(), 19.3, 11};
  for (std::size_t n = 0; n < tone.samples; ++n) {
    const double z = std::clamp(1 + 11 * std::cos(2 * M_PI * 0.193 * static_cast<double>(n) + 0.7),
                                -limit_g, limit_g);
    long count = std::lround(256 * z);
    count = wraps ? ((count + 2048) % 4096 + 4096) % 4096 - 2048 : std::clamp(count, -2048L, 2047L);
    bundle.samples.push_back({0, 0, static_cast<std::int16_t>(count)});
  }
  bundle.segments.push_back(tone);
  return bundle;
}

TEST(Clean, SaturationWrapAndFullScaleAreToldApart) {
  const CleanSamples full = clean_samples(with_high_tone(100, false));
  EXPECT_FALSE(full.saturated);
  EXPECT_EQ(full.wrapped_samples, 0U);
  EXPECT_GT(full.full_scale_samples, 100U);

  const CleanSamples saturated = clean_samples(with_high_tone(6, false));
  EXPECT_TRUE(saturated.saturated);
  EXPECT_EQ(saturated.plateau_lsb[2][1], 1536);
  EXPECT_EQ(saturated.plateau_lsb[2][0], -1536);

  const Bundle wrapped = with_high_tone(100, true);
  const CleanSamples undone = clean_samples(wrapped);
  EXPECT_FALSE(undone.saturated);
  EXPECT_GT(undone.wrapped_samples, 100U);
  // Undone means: the tone again, 12 g at its crest.
  int highest = 0;
  for (std::size_t i = 18'000; i < undone.samples.size(); ++i) {
    highest = std::max<int>(highest, undone.samples[i][2]);
  }
  EXPECT_NEAR(highest, 12 * 256, 40);
}

// 6 g at 20 Hz: of five samples one is at the crest, and all of the crest is one count.
TEST(Clean, ACrestOfOneSampleIsNoPlateau) {
  Bundle bundle = with_high_tone(100, false);
  Segment& tone = bundle.segments.back();
  tone.vibration = Vibration{Eigen::Vector3d::UnitZ(), 20, 6};
  for (std::size_t n = 0; n < tone.samples; ++n) {
    const double z = 1 + 6 * std::cos(2 * M_PI * 0.2 * static_cast<double>(n));
    bundle.samples[tone.first_sample + n][2] = static_cast<std::int16_t>(std::lround(256 * z));
  }
  const CleanSamples clean = clean_samples(bundle);
  EXPECT_FALSE(clean.saturated);
  EXPECT_EQ(clean.driven_g, 0) << "the tone can't show one";
}

// Samples that are lost put a tone out of step, half a turn at 20 Hz and 80 Hz; 6 g reach no limit.
TEST(Clean, ATonePutOutOfStepDoesNotWrap) {
  for (std::size_t lost_at = 1; lost_at < 50; ++lost_at) {
    Bundle bundle = with_high_tone(100, false);
    bundle.rate_hz = 80;
    Segment& tone = bundle.segments.back();
    tone.vibration = Vibration{Eigen::Vector3d::UnitZ(), 20, 6};
    for (std::size_t n = 0; n < tone.samples; ++n) {
      const std::size_t slips = n < 100 + lost_at ? 0 : 2;
      const double z = 1 + 6 * std::cos(2 * M_PI * 0.25 * static_cast<double>(n + slips));
      bundle.samples[tone.first_sample + n][2] = static_cast<std::int16_t>(std::lround(256 * z));
    }
    EXPECT_EQ(clean_samples(bundle).wrapped_samples, 0U) << lost_at;
  }
}

// Samples that are lost put a tone out of step; where it clips, nothing came back by 4096.
TEST(Clean, AUnitThatClipsDoesNotWrap) {
  for (std::size_t lost_at = 1; lost_at < 50; ++lost_at) {
    Bundle bundle = with_high_tone(100, false);
    const Segment& tone = bundle.segments.back();
    for (std::size_t n = 0; n < tone.samples; ++n) {
      const std::size_t slips = (n + 50 - lost_at) / 50;
      const double z = 1 + 11 * std::cos(2 * M_PI * 0.24125 * static_cast<double>(n + slips));
      const long count = std::clamp(std::lround(256 * z), -2048L, 2047L);
      bundle.samples[tone.first_sample + n][2] = static_cast<std::int16_t>(count);
    }
    bundle.segments.back().vibration->frequency_hz = 24.125;  // 19.3 Hz at 80 Hz
    EXPECT_EQ(clean_samples(bundle).wrapped_samples, 0U) << lost_at;
  }
}

// By hand: 3 and 5 LSB of 250 LSB/g are 12 and 20 mg; the clipped 2000 does not count, the wrapped
// 7 does.
TEST(Clean, MeansAreOfUsableSamples) {
  CleanSamples clean;
  clean.accel_scale_lsb_per_g = 250;
  clean.samples = {{0, 0, 3}, {0, 0, 5}, {0, 0, 2000}, {0, 0, 7}};
  clean.flags = {kSampleGood, kSampleGood, kSampleClipped, kSampleWrapped};
  EXPECT_EQ(clean.count_usable(0, 3), 2U);
  EXPECT_NEAR(clean.mean_mg(0, 3, 2), 16, 1e-12);
  EXPECT_EQ(clean.count_usable(1, 3), 2U);
  EXPECT_NEAR(clean.mean_mg(1, 3, 2), 24, 1e-12);
  EXPECT_EQ(clean.count_usable(2, 1), 0U);
  EXPECT_EQ(clean.mean_mg(2, 1, 2), 0);
}

}  // namespace
}  // namespace sixpoint::gap
