// Stretches made of cosines and of noise: what the scans must say of them is known in closed form.
#include "gap/features/line_scan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

constexpr double kRate_hz = 100;
constexpr std::size_t kDwell = 1000;  // samples
constexpr double kLine_hz = 12.5;     // a bin of every scan, whole periods in a dwell

NoiseSpectrum white(const Eigen::Vector3d& variance_mg2) {
  NoiseSpectrum noise;
  noise.blocks = 100;
  for (double f = 1.5; f <= kRate_hz / 2; f += noise.step_hz) {
    noise.frequency_hz.push_back(f);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      noise.variance_mg2[axis].push_back(variance_mg2[static_cast<Eigen::Index>(axis)]);
    }
  }
  return noise;
}

// value(t) at t seconds of the host's clock, in the sensor's frame.
template <class Value>
Stretch stretch(double start_s, std::size_t samples, const Value& value,
                const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity()) {
  Stretch made;
  made.samples = samples;
  made.known = samples;
  made.start_s = start_s;
  made.rotation = rotation;
  for (std::size_t i = 0; i < samples; ++i) {
    const Eigen::Vector3d x = value(start_s + static_cast<double>(i) / kRate_hz);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      made.x[axis].push_back(x[static_cast<Eigen::Index>(axis)]);
    }
  }
  return made;
}
auto cosine(const Eigen::Vector3d& amplitude_mg, double frequency_hz, double phase = 0) {
  return [=](double t) {
    return Eigen::Vector3d(std::cos(2 * M_PI * frequency_hz * t + phase) * amplitude_mg);
  };
}

std::vector<const Stretch*> all_of(const std::vector<Stretch>& all) {
  std::vector<const Stretch*> set;
  for (const Stretch& s : all) {
    set.push_back(&s);
  }
  return set;
}
std::size_t bin_of(const LineScan& scan, double frequency_hz) {
  return static_cast<std::size_t>(std::lround(frequency_hz / scan.step_hz));
}
double nats_at(const LineScan& scan, double frequency_hz) {
  return scan.nats.at(bin_of(scan, frequency_hz));
}

// Chernoff's bound of the tail of a gamma law of shape 3: three axes, in units of their noise.
double gamma_nats(double x) { return x - 3 - 3 * std::log(x / 3); }

// Dwells of noise alone, of sd 1 mg, a minute apart.
std::vector<Stretch> noise_dwells(std::size_t dwells, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Stretch> all;
  for (std::size_t i = 0; i < dwells; ++i) {
    all.push_back(stretch(30 + 50 * static_cast<double>(i), kDwell, [&](double) {
      return Eigen::Vector3d(normal(random), normal(random), normal(random));
    }));
  }
  return all;
}
void add(std::vector<Stretch>& all, const Eigen::Vector3d& amplitude_mg, double frequency_hz) {
  for (Stretch& s : all) {
    const Stretch line = stretch(s.start_s, s.samples, cosine(amplitude_mg, frequency_hz));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < s.samples; ++i) {
        s.x[axis][i] += line.x[axis][i];
      }
    }
  }
}

// The spectrum of N samples of a cos has the power (N a / 2)^2 at its bin, white noise N s^2.
TEST(LineScan, OneStretchOfALineHasTheNatsOfItsPower) {
  const Eigen::Vector3d amplitude(0.5, -0.3, 0.8);
  const Eigen::Vector3d variance(1, 4, 2);
  const Stretch one = stretch(0, 1024, cosine(amplitude, kLine_hz, 0.7));
  const LineScan scan = scan_powers(kRate_hz, {&one}, white(variance));
  EXPECT_EQ(scan.nats.size(), 1024U);
  EXPECT_NEAR(scan.step_hz, kRate_hz / 2048, 1e-12) << "half-bin steps";
  const double x = 1024 / 4.0 * amplitude.cwiseAbs2().cwiseQuotient(variance).sum();
  EXPECT_NEAR(nats_at(scan, kLine_hz), gamma_nats(x), 1e-6);
  const auto most = std::max_element(scan.nats.begin(), scan.nats.end());
  EXPECT_EQ(static_cast<std::size_t>(most - scan.nats.begin()), bin_of(scan, kLine_hz));
  EXPECT_EQ(nats_at(scan, 30), 0);
}

// The worst place of a line is a quarter of its own bin away from a step: sinc(1/4)^2 = 0.81.
TEST(LineScan, LineBetweenTwoStepsLosesAFifthOfItsPowerAtMost) {
  const Stretch one = stretch(0, 1024, cosine({1, 0, 0}, kLine_hz + kRate_hz / 4096));
  const LineScan scan = scan_powers(kRate_hz, {&one}, white(Eigen::Vector3d::Ones()));
  const double sinc = std::sin(M_PI / 4) / (M_PI / 4);
  EXPECT_NEAR(nats_at(scan, kLine_hz), gamma_nats(256 * sinc * sinc), 1.5);
}

// A line that turns with the unit and one that stays in the laboratory show alike.
TEST(LineScan, BothFramesAreSearchedByPowersAndInStep) {
  const Eigen::Vector3d amplitude(0.4, 0.2, -0.3);
  const NoiseSpectrum noise = white(Eigen::Vector3d::Ones());
  std::vector<Stretch> sensor;
  std::vector<Stretch> lab;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Matrix3d r = tests::up_along(i / 2, i % 2 == 0 ? 1 : -1, i % 4);
    const double start_s = 30 + 17.3 * i;
    sensor.push_back(stretch(start_s, kDwell, cosine(amplitude, kLine_hz), r));
    lab.push_back(stretch(start_s, kDwell, cosine(r * amplitude, kLine_hz), r));
  }
  const double x = 6 * kDwell / 4.0 * amplitude.squaredNorm();
  for (const auto* all : {&sensor, &lab}) {
    const LineScan step = scan_in_step(kRate_hz, *all, noise);
    EXPECT_NEAR(nats_at(step, kLine_hz), gamma_nats(x) - std::log(2), 1e-6);
  }
  const double powers = nats_at(scan_powers(kRate_hz, all_of(sensor), noise), kLine_hz);
  EXPECT_GT(powers, 100);
  EXPECT_NEAR(powers, nats_at(scan_powers(kRate_hz, all_of(lab), noise), kLine_hz), 1e-6);
}

TEST(LineScan, InStepWantsThePhaseOfTheHostsClockAndPowersDoNot) {
  const NoiseSpectrum noise = white(Eigen::Vector3d::Ones());
  std::vector<Stretch> out_of_step;
  for (int i = 0; i < 6; ++i) {  // phases that cancel
    out_of_step.push_back(
        stretch(30 + 17.3 * i, kDwell, cosine({0.4, 0, 0}, kLine_hz, 2 * M_PI * i / 6)));
  }
  EXPECT_NEAR(nats_at(scan_in_step(kRate_hz, out_of_step, noise), kLine_hz), 0, 1);
  EXPECT_GT(nats_at(scan_powers(kRate_hz, all_of(out_of_step), noise), kLine_hz), 100);
}

TEST(LineScan, InStepTakesDwellsOfAQuarterOfAnHourAndFourAtLeast) {
  const NoiseSpectrum noise = white(Eigen::Vector3d::Ones());
  std::vector<Stretch> all;
  for (const double start_s : {100.0, 200.0, 300.0, 1000.0}) {
    all.push_back(stretch(start_s, kDwell, cosine({1, 0, 0}, kLine_hz)));
  }
  EXPECT_TRUE(scan_in_step(kRate_hz, {all.begin(), all.begin() + 3}, noise).nats.empty());
  all[3].start_s = 999;  // 899 s after the first
  EXPECT_FALSE(scan_in_step(kRate_hz, all, noise).nats.empty());
  all[3].start_s = 1001;
  EXPECT_TRUE(scan_in_step(kRate_hz, all, noise).nats.empty());
}

// The nats are no less than the chance has: noise shows t nats in a share of at most exp(-t) of the
// frequencies. In one frame a gamma law of shape 3 is beyond x = 8.983, which has 2 nats and ln 2,
// with the chance exp(-x) (1 + x + x^2 / 2) = 0.0063.
TEST(LineScan, NoiseInStepHasTheGammaLawOfShapeThree) {
  double beyond = 0;
  double bins = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    const LineScan scan =
        scan_in_step(kRate_hz, noise_dwells(6, seed), white(Eigen::Vector3d::Ones()));
    beyond += static_cast<double>(
        std::count_if(scan.nats.begin(), scan.nats.end(), [](double n) { return n > 2; }));
    bins += static_cast<double>(scan.nats.size());
  }
  ASSERT_GT(bins, 0);
  EXPECT_NEAR(beyond / bins, 0.0063, 0.0025);  // 3000 of a scan's frequencies are independent
}

TEST(LineScan, NoiseShowsNoMoreNatsThanItsChanceInPowers) {
  for (const std::size_t dwells : {1U, 4U, 18U}) {
    double beyond = 0;
    double bins = 0;
    for (unsigned seed = 1; seed <= 8; ++seed) {
      const auto all = noise_dwells(dwells, seed);
      const LineScan scan = scan_powers(kRate_hz, all_of(all), white(Eigen::Vector3d::Ones()));
      beyond += static_cast<double>(
          std::count_if(scan.nats.begin(), scan.nats.end(), [](double n) { return n > 2; }));
      bins += static_cast<double>(scan.nats.size());
    }
    ASSERT_GT(bins, 0);
    EXPECT_LT(beyond / bins, std::exp(-2)) << dwells;
    EXPECT_GT(beyond / bins, std::exp(-2) / 60) << dwells << ": a bound, but no idle one";
  }
}

// Summed with their phases the dwells have 18 * 1000 * 0.06^2 / 4 = 16 more than noise, which is
// more than ten nats; their powers have less than the half of it.
TEST(LineScan, InStepShowsAWeakerLineThanPowers) {
  const NoiseSpectrum noise = white(Eigen::Vector3d::Ones());
  double in_step = 0;
  double by_powers = 0;
  for (const unsigned seed : {1U, 2U, 3U}) {
    auto all = noise_dwells(18, seed);
    add(all, {0.06, 0, 0}, kLine_hz);
    in_step += nats_at(scan_in_step(kRate_hz, all, noise), kLine_hz) / 3;
    by_powers += nats_at(scan_powers(kRate_hz, all_of(all), noise), kLine_hz) / 3;
  }
  EXPECT_GT(in_step, 10);
  EXPECT_LT(by_powers, in_step / 2);
}

// Lines of the size that is said to have twelve nats half of the time have them in about half of the
// scans, whatever the scan: powers of one stretch and of eighteen, and all in step.
TEST(LineScan, TheShownLineIsShownHalfOfTheTime) {
  const NoiseSpectrum noise = white(Eigen::Vector3d::Ones());
  constexpr double kNats = 12;
  constexpr int kScans = 20;
  for (const std::size_t dwells : {0U, 1U, 18U}) {  // 0: in step
    const auto scan_of = [&](const std::vector<Stretch>& all) {
      return dwells == 0 ? scan_in_step(kRate_hz, all, noise)
                         : scan_powers(kRate_hz, all_of(all), noise);
    };
    int shown = 0;
    for (unsigned seed = 1; seed <= static_cast<unsigned>(kScans); ++seed) {
      auto all = noise_dwells(dwells == 0 ? 18 : dwells, seed);
      const double size_mg = shown_line_mg(scan_of(all), kNats, Eigen::Vector3d::Ones());
      add(all, {size_mg, 0, 0}, kLine_hz);
      shown += nats_at(scan_of(all), kLine_hz) > kNats ? 1 : 0;
    }
    // The line lies on a bin, where the scan has 1 / 0.95 as much.
    EXPECT_GT(shown, kScans / 4) << dwells;
    EXPECT_LT(shown, kScans - kScans / 10) << dwells;
  }
}

}  // namespace
}  // namespace sixpoint::gap
