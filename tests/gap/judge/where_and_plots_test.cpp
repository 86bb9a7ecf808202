#include <random>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

// White noise of s mg at 100 Hz: the Allan deviation of means of tau seconds is s / sqrt(100 tau).
TEST(MakePlots, AllanDeviationOfWhiteNoise) {
  Bundle bundle;
  Segment still;
  still.samples = 60'000;
  bundle.segments = {still};
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 8);
  for (std::size_t i = 0; i < still.samples; ++i) {
    const auto value = [&] { return static_cast<std::int16_t>(std::lround(normal(random))); };
    bundle.samples.push_back({value(), value(), value()});
  }
  const DiagnoseOptions options;
  Records records;
  records.clean.samples = bundle.samples;
  records.clean.flags.assign(still.samples, kSampleGood);
  const Plots plots = make_plots({bundle, options}, records, {}, {});
  const double noise_mg = std::sqrt(64 + 1.0 / 12) * 1000 / 256;  // rounding included
  ASSERT_GE(plots.allan_s.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(plots.allan_mg[1][i] / (noise_mg / std::sqrt(100 * plots.allan_s[i])), 1, 0.15);
  }
}

bool is_there(const std::vector<UnknownPlace>& places, int axis, const std::string& segment) {
  return std::any_of(places.begin(), places.end(), [&](const UnknownPlace& place) {
    return place.axis == axis && place.segment == segment;
  });
}

// A line, and ringing after moves: all places are segments that the recording has, and the ringing
// is on an axis that gravity leaves or comes to.
TEST(LocateResiduals, AllPlacesAreSegmentsOfTheRecording) {
  const Bundle bundle = tests::made_production({}, [](const Segment& s, double t) {
    const double ring = 0.04 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6 * t);
    const double line_g = 0.003 * std::sin(2 * M_PI * 12 * t + static_cast<double>(s.first_sample));
    return Eigen::Vector3d(s.rotation.col(2) + ring * s.approach_g +
                           line_g * Eigen::Vector3d(0.6, 0, 0.8));
  });
  const auto diagnosis = diagnose(bundle);
  ASSERT_OK(diagnosis);
  int lines = 0;
  int ringing = 0;
  for (const Location& place : diagnosis->where) {
    EXPECT_TRUE(std::ranges::any_of(bundle.segments, [&](const Segment& segment) {
      return segment.name == place.segment;
    })) << place.segment;
    lines += place.factor.starts_with("frequency ") ? 1 : 0;
    ringing += place.factor == "time since move" ? 1 : 0;
  }
  EXPECT_EQ(lines, 3);
  EXPECT_EQ(ringing, 1);
}

// Moves along y alone, under a name of its own: there it rings.
TEST(LocateResiduals, RingingIsOnTheAxisThatMoves) {
  Bundle bundle = tests::made_production({}, [](const Segment& s, double t) {
    const double ring = 0.04 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6 * t);
    return Eigen::Vector3d(s.rotation.col(2) + ring * s.approach_g);
  });
  for (Segment& segment : bundle.segments) {
    segment.name = "turned over";
    segment.approach_g[0] /= 2;
    segment.approach_g[2] /= 2;
  }
  const auto diagnosis = diagnose(bundle);
  ASSERT_OK(diagnosis);
  const auto place = std::ranges::find(diagnosis->where, "time since move", &Location::factor);
  ASSERT_NE(place, diagnosis->where.end()) << diagnosis->brief();
  EXPECT_EQ(place->axis, 1);
  EXPECT_EQ(place->segment, "turned over");
}

// The zero of z moves by 8 mg between two runs of segments: z shows it, x and y do not.
TEST(LocateUnknown, AZeroThatMovesIsOnItsAxis) {
  const Bundle bundle = tests::made_production({}, [](const Segment& s, double) {
    return Eigen::Vector3d(s.rotation.col(2) +
                           Eigen::Vector3d(0, 0, s.name == "reseat" ? 0.008 : 0));
  });
  const auto diagnosis = diagnose(bundle);
  ASSERT_OK(diagnosis);
  ASSERT_TRUE(diagnosis->unknown.present);
  EXPECT_TRUE(is_there(diagnosis->unknown.where, 2, "reseat"));
  EXPECT_FALSE(is_there(diagnosis->unknown.where, 0, "reseat"));
  EXPECT_FALSE(is_there(diagnosis->unknown.where, 1, "faces"));
}

// Noise of y half as loud again in one run of segments.
TEST(LocateUnknown, LouderNoiseIsWhereItIsLoud) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal(0, 0.0045);
  const Bundle bundle = tests::made_production({}, [&](const Segment& s, double) {
    return Eigen::Vector3d(s.rotation.col(2) +
                           Eigen::Vector3d(0, s.name == "reseat" ? normal(random) : 0, 0));
  });
  const auto diagnosis = diagnose(bundle);
  ASSERT_OK(diagnosis);
  ASSERT_TRUE(diagnosis->unknown.present);
  ASSERT_FALSE(diagnosis->unknown.where.empty());
  EXPECT_EQ(diagnosis->unknown.where.front().axis, 1);
  EXPECT_EQ(diagnosis->unknown.where.front().segment, "reseat");
  EXPECT_EQ(diagnosis->unknown.where.front().factor, "noise");
}

}  // namespace
}  // namespace sixpoint::gap
