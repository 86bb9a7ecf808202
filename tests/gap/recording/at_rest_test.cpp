// Segments one behind the other, of known length and with known marks.
#include "gap/recording/at_rest.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

struct MadeSegments {
  Bundle bundle;
  CleanSamples clean;
};

// Segments of Z = 256 LSB, one behind the other. X goes up and down by a count so that four samples
// have neither a mean nor a slope.
MadeSegments made(const std::vector<Segment>& segments) {
  MadeSegments made;
  for (Segment segment : segments) {
    segment.first_sample = made.clean.samples.size();
    for (std::size_t i = 0; i < segment.samples; ++i) {
      const int sign = i % 4 == 0 || i % 4 == 3 ? 1 : -1;
      made.clean.samples.push_back({static_cast<std::int16_t>(5 + sign), 0, 256});
    }
    made.bundle.segments.push_back(segment);
  }
  made.bundle.samples = made.clean.samples;
  made.clean.flags.assign(made.clean.samples.size(), kSampleGood);
  return made;
}
Segment segment(Segment::Kind kind, std::size_t samples, bool starts_placement) {
  Segment segment;
  segment.kind = kind;
  segment.samples = samples;
  segment.starts_placement = starts_placement;
  segment.host_start_s = 50;
  return segment;
}

// Three seconds ring after a move; what is left must be four seconds at rest.
TEST(AtRest, StretchesAreFourQuietSecondsAndMoreAtRest) {
  using Kind = Segment::Kind;
  const MadeSegments made =
      gap::made({segment(Kind::still, 700, true), segment(Kind::still, 699, true),
                 segment(Kind::still, 400, false), segment(Kind::still, 399, false),
                 segment(Kind::soak, 2000, true), segment(Kind::ramp, 2000, true),
                 segment(Kind::vibration, 2000, true)});
  const auto found = stretches(made.bundle, made.clean);
  ASSERT_EQ(found.size(), 4U);
  const std::size_t samples[] = {400, 400, 1700, 1700};
  const double start_s[] = {53, 50, 53, 53};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found[i].samples, samples[i]);
    EXPECT_EQ(found[i].x[0].size(), samples[i]);
    EXPECT_NEAR(found[i].start_s, start_s[i], 1e-9);
  }
}

// One LSB is 3.90625 mg.
TEST(AtRest, StretchesAreInMgAboutTheirMeanWithMaskedSamplesZero) {
  MadeSegments made = gap::made({segment(Segment::Kind::still, 400, false)});
  for (std::size_t i = 100; i < 108; ++i) {
    made.clean.samples[i] = {2000, 2000, 2000};
    made.clean.flags[i] = kSampleClipped;
  }
  const auto found = stretches(made.bundle, made.clean);
  ASSERT_EQ(found.size(), 1U);
  for (std::size_t i = 0; i < 400; ++i) {
    const bool masked = i >= 100 && i < 108;
    const bool up = i % 4 == 0 || i % 4 == 3;
    EXPECT_NEAR(found[0].x[0][i], masked ? 0 : up ? 3.90625 : -3.90625, 1e-9) << i;
    EXPECT_NEAR(found[0].x[2][i], 0, 1e-9) << i;
  }
}

// A zero that follows the temperature of a ramp, a count a sample, leaves nothing.
TEST(AtRest, StretchesHaveNoTrend) {
  MadeSegments made = gap::made({segment(Segment::Kind::ramp, 400, false)});
  for (std::size_t i = 0; i < 400; ++i) {
    made.clean.samples[i][1] = static_cast<std::int16_t>(static_cast<int>(i) - 150);
  }
  for (std::size_t i = 100; i < 110; ++i) {
    made.clean.samples[i] = {2000, 2000, 2000};
    made.clean.flags[i] = kSampleClipped;
  }
  const auto found = stretches(made.bundle, made.clean);
  ASSERT_EQ(found.size(), 1U);
  for (const double y_mg : found[0].x[1]) {
    EXPECT_NEAR(y_mg, 0, 1e-9);
  }
}

TEST(AtRest, StretchWithMoreThanATenthMaskedIsLeftOut) {
  MadeSegments made = gap::made({segment(Segment::Kind::still, 400, false)});
  std::fill_n(made.clean.flags.begin(), 40, std::uint8_t{kSampleZero});
  EXPECT_EQ(stretches(made.bundle, made.clean).size(), 1U);
  made.clean.flags[40] = kSampleHeld;
  EXPECT_TRUE(stretches(made.bundle, made.clean).empty());
}

// Two samples are lost in [100, 200), three are there twice in [400, 500).
TEST(AtRest, PlacesFollowTheClock) {
  MadeSegments made = gap::made(
      {segment(Segment::Kind::still, 50, false), segment(Segment::Kind::still, 600, false)});
  made.clean.slips = {{150, 250, 2}, {450, 550, -3}};
  for (const ClockSlip& slip : made.clean.slips) {
    std::fill(made.clean.flags.begin() + static_cast<std::ptrdiff_t>(slip.first),
              made.clean.flags.begin() + static_cast<std::ptrdiff_t>(slip.last), kSampleSlipped);
  }
  made.clean.flags[60] = kSampleHeld;
  const Segment& second = made.bundle.segments[1];
  const Places places = places_by_clock(made.clean, second, 600);
  EXPECT_EQ(places[0], 0U);
  EXPECT_FALSE(places[10]) << "held";
  EXPECT_EQ(places[99], 99U);
  EXPECT_FALSE(places[100]);
  EXPECT_FALSE(places[199]);
  EXPECT_EQ(places[200], 202U);
  EXPECT_EQ(places[399], 401U);
  EXPECT_EQ(places[500], 499U);

  const auto found = stretches(made.bundle, made.clean);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].samples, 599U);
  EXPECT_EQ(found[0].known, 399U);
  EXPECT_EQ(found[0].x[0][150], 0);
  EXPECT_FALSE(found[0].is_known[150]);
  EXPECT_TRUE(found[0].is_known[202]);

  // More than a second holds: the clock was set, and says nothing of places.
  made.clean.slips[1].lost = -100;
  EXPECT_EQ(places_by_clock(made.clean, second, 600)[500], 500U);
  made.clean.slips[1].lost = 1'000'000;
  EXPECT_EQ(places_by_clock(made.clean, second, 600)[500], 500U);

  // Slips in more than half of its seconds.
  made.clean.slips[1].lost = -3;
  std::fill_n(made.clean.flags.begin() + 50, 320, kSampleSlipped);
  EXPECT_TRUE(stretches(made.bundle, made.clean).empty());
}

// By hand: 300 samples ring after the move, 1700 are left; the segment begins at sample 100.
TEST(AtRest, PiecesFollowOneAnotherFromWhereRingingIsOver) {
  using Kind = Segment::Kind;
  const MadeSegments made =
      gap::made({segment(Kind::vibration, 100, true), segment(Kind::still, 2000, true),
                 segment(Kind::ramp, 50, false)});
  const auto pieces = rest_pieces(made.bundle, 1, 600);
  ASSERT_EQ(pieces.size(), 3U);
  const std::size_t first[] = {400, 1000, 1600};
  const std::size_t samples[] = {600, 600, 500};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(pieces[i].segment, 1U);
    EXPECT_EQ(pieces[i].first, first[i]);
    EXPECT_EQ(pieces[i].samples, samples[i]);
  }
  const auto third = rest_pieces(made.bundle, 1, 300, 3);  // 0, 900 of the 1700
  ASSERT_EQ(third.size(), 2U);
  EXPECT_EQ(third[1].first, 400U + 900);
  EXPECT_EQ(third[1].samples, 300U);
  EXPECT_TRUE(rest_pieces(made.bundle, 0, 10).empty()) << "a shaker moves it";
  const auto ramp = rest_pieces(made.bundle, 2, 60);
  ASSERT_EQ(ramp.size(), 1U);
  EXPECT_EQ(ramp[0].first, 2100U);
  EXPECT_EQ(ramp[0].samples, 50U);
}

}  // namespace
}  // namespace sixpoint::gap
