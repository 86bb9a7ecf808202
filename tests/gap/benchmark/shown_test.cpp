#include "gap/benchmark/shown.h"

#include <functional>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

// Four segments of 10 s in which the X axis lies across gravity, and the differences of their
// counts given by hand.
struct Made {
  sim::ProtocolRun run;
  sim::ProtocolRecord without, with;
  Made() {
    for (std::uint64_t i = 0; i < 4; ++i) {
      sim::ProtocolSegment segment;
      segment.name = i < 2 ? "faces" : "reseat";
      segment.first_sample = 1000 * i;
      segment.samples = 1000;
      segment.host_start_s = 60.0 * static_cast<double>(i);  // taken up in between
      run.segments.push_back(segment);
    }
    without.counts.resize(4000);
    without.sample_time_s.resize(4000);
    with = without;
  }
  void change(const std::function<int(std::size_t)>& difference) {
    for (std::size_t i = 0; i < with.counts.size(); ++i) {
      with.counts[i][0] = static_cast<std::int16_t>(difference(i));
    }
  }
  Shown shown() const { return what_is_shown(run, without, with); }
};

constexpr double kLsb_mg = 1000.0 / 256;

// By hand: a count up in two segments and down in the others; no offset takes any of it. Noise of
// a mean: (3.9^2 + 3.90625^2 / 12) / 1000 + 0.17^2 = 0.0453816 mg^2; 15.258789 / 0.0453816 each.
TEST(Shown, MeansByHand) {
  Made made;
  made.change([](std::size_t i) { return (i / 1000) % 2 == 0 ? 1 : -1; });
  const Shown shown = made.shown();
  EXPECT_NEAR(shown.means, 4 * 336.233, 0.05);
  EXPECT_EQ(shown.samples, 0);
  EXPECT_EQ(shown.times, 0);
  EXPECT_NEAR(shown.index(), 36.673, 0.002);
  EXPECT_NEAR(shown.by_place.at({0, "faces"}), 2 * 336.233, 0.05);
  EXPECT_EQ(shown.by_place.at({1, "faces"}), 0);
}

// An offset of a count is what units have: of 35 mg it is a ninth.
TEST(Shown, AnOffsetIsTheUnitsOwn) {
  Made made;
  made.change([](std::size_t) { return 1; });
  EXPECT_NEAR(made.shown().means, kLsb_mg * kLsb_mg / (35 * 35), 1e-3);
}

// So is a gain, wherever it shows: ten counts in 1000 of what the shaker makes are half of its 2 %,
// and as a signal would be 93 in each of 4000 samples.
TEST(Shown, AGainIsTheUnitsOwnInSamplesToo) {
  Made made;
  for (std::size_t i = 0; i < made.without.counts.size(); ++i) {
    made.without.counts[i][0] = static_cast<std::int16_t>(i % 2 == 0 ? 1000 : -1000);
  }
  made.change([](std::size_t i) { return i % 2 == 0 ? 1010 : -1010; });
  EXPECT_NEAR(made.shown().samples, 0, 0.01);
  EXPECT_LT(made.shown().index(), 0.5);
}

// The cube of a tone of known gain shows by all its samples, that of a unit whose gain no segment
// shows by the harmonic alone: sin^3 = 3/4 sin - 1/4 sin 3p, a tenth of the square.
TEST(Shown, OfACubeTheHarmonicIsBeyondTheGain) {
  Made made;
  const auto wave = [](std::size_t i, double cube) {
    const double s = std::sin(0.61 * static_cast<double>(i));
    return static_cast<std::int16_t>(std::lround(1500 * s + cube * s * s * s));
  };
  for (std::size_t i = 0; i < made.without.counts.size(); ++i) {
    made.without.counts[i][0] = wave(i, 0);
  }
  constexpr double kCube_counts = 100;
  made.change([&](std::size_t i) { return wave(i, kCube_counts); });
  const double noise_mg2 = 3.9 * 3.9 + kLsb_mg * kLsb_mg / 12;
  const double whole = 4000 * std::pow(kCube_counts * kLsb_mg, 2) * 5 / 16 / noise_mg2;
  // About zero the samples do not differ by more than rounding does.
  EXPECT_NEAR(made.shown().samples, whole / 10, 0.07 * whole / 10);
}

// A seat turns what a shaker moves, as it turns gravity: three counts across 1000 are 3 mg of 1 g, in
// a seat of 0.17 mg, one number for each placement, and in the noise of its samples. What the counts
// scatter about their mean is subtracted from the means: (3 LSB)^2 / 16.4816 of each of four.
TEST(Shown, ASeatIsThePlacementsOwnInSamplesToo) {
  for (const bool taken_up : {true, false}) {
    Made made;
    for (sim::ProtocolSegment& segment : made.run.segments) {
      segment.host_start_s = static_cast<double>(segment.first_sample) * (taken_up ? 0.06 : 0.01);
    }
    for (std::size_t i = 0; i < made.without.counts.size(); ++i) {
      made.without.counts[i][1] = static_cast<std::int16_t>(i % 2 == 0 ? 1000 : -1000);
    }
    made.with = made.without;
    made.change([](std::size_t i) { return i % 2 == 0 ? 3 : -3; });
    const double samples = taken_up ? 1000 : 4000;
    const double noise = 16.4816 / (samples * std::pow(kLsb_mg, 2));
    const double all = 4000 / samples * 9 / (kSeating_mg * kSeating_mg + noise);
    const double scatter = 4 * std::pow(3 * kLsb_mg, 2) / 16.4816;
    EXPECT_NEAR(std::pow(made.shown().index(), 2), all - scatter, 0.5);
  }
}

// A line of two counts, up and down: 61.035 / 16.4816 each sample, and no mean.
TEST(Shown, SamplesByHand) {
  Made made;
  made.change([](std::size_t i) { return i % 2 == 0 ? 2 : -2; });
  const Shown shown = made.shown();
  EXPECT_NEAR(shown.samples, 4000 * 3.70323, 1);
  EXPECT_NEAR(shown.index(), std::sqrt(4000 * 3.70323), 0.1);
}

// A steady change of a third of a count, rounded: a third of the samples differ. What rounding
// scatters is not taken for a signal: the mean alone shows.
TEST(Shown, RoundingIsNoSignal) {
  Made made;
  made.change([](std::size_t i) { return i % 3 == 0 ? ((i / 1000) % 2 == 0 ? 1 : -1) : 0; });
  const Shown shown = made.shown();
  EXPECT_EQ(shown.samples, 0);
  EXPECT_NEAR(shown.means, 4 * 336.233 / 9, 4 * 336.233 / 9 * 0.01);
}

// A clock off by 100 ppm in one segment: ten packets, sum of squares about the mean 82.5e-8 s^2,
// of (2 ms)^2 / 3: 0.61875.
TEST(Shown, TimesByHand) {
  Made made;
  for (std::size_t i = 0; i < 1000; ++i) {
    made.with.sample_time_s[i] += 1e-4 * static_cast<double>(i) / 100;
  }
  EXPECT_NEAR(made.shown().times, 0.61875, 1e-9);
}

}  // namespace
}  // namespace sixpoint::gap
