#include "calib/scaling.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "calib/constants.h"
#include "expect_result.h"
#include "synthetic_unit.h"

namespace sixpoint::calib {
namespace {

using tests::firmware_count;

// The constants of a real affected unit (domain.md's example), one with steeper scaling, one odd.
StoredConstants affected() { return {{311, 310, 287}, {-204, -216, -234}, {54, 47, 26}}; }
StoredConstants steep() { return {{240, 246, 251}, {-238, -256, -261}, {3, -4, -5}}; }
StoredConstants half() { return {{512, 1024, 2047}, {-512, -1024, -2048}, {0, 7, -3}}; }

TEST(Reversal, FindsEveryRawCountAgain) {
  for (const StoredConstants& stored : {affected(), steep(), half()}) {
    const auto reversal = Reversal::make(stored, 256, RecordWidth::bits12);
    ASSERT_OK(reversal);
    for (std::size_t a = 0; a < kAxes; ++a) {
      const int span = stored.positive_lsb[a] - stored.negative_lsb[a];
      const int most = (span + 511) / 512;
      for (int raw = -2048; raw <= 2047; ++raw) {
        const auto count = firmware_count(stored, 256, a, raw);
        if (reversal->clipped(count)) {
          continue;
        }
        const RawCandidates found = reversal->candidates(a, count);
        ASSERT_GE(found.number, 1);
        ASSERT_LE(found.number, most);
        ASSERT_FALSE(found.tie);
        ASSERT_LE(found.first, raw);
        ASSERT_GE(found.first + found.number - 1, raw);
      }
    }
  }
}

// positive - negative = 478 < 512: some stored counts have no integer behind them, and those are
// just what the forward rule never gives.
TEST(Reversal, KnowsWhatCannotHaveBeen) {
  const auto reversal = Reversal::make(steep(), 256, RecordWidth::bits12);
  ASSERT_OK(reversal);
  std::array<bool, 4096> reached{};
  for (int raw = -32768; raw <= 32767; ++raw) {
    const double value = 512.0 * (raw - 3) / 478;
    for (const int count : {tests::rounded(value), static_cast<int>(std::trunc(value))}) {
      const bool rounds_here =
          count == tests::rounded(value) || std::abs(value - std::trunc(value)) == 0.5;
      if (rounds_here && count >= -2048 && count <= 2047) {
        reached[static_cast<std::size_t>(count + 2048)] = true;
      }
    }
  }
  int impossible = 0;
  std::vector<StoredCounts> samples;
  for (int count = -2047; count < 2047; ++count) {
    EXPECT_EQ(reversal->candidates(0, count).number > 0,
              reached[static_cast<std::size_t>(count + 2048)])
        << count;
    impossible += reached[static_cast<std::size_t>(count + 2048)] ? 0 : 1;
    // Axes Y and Z hold 0, which is reached.
    samples.push_back({static_cast<std::int16_t>(count), 0, 0});
  }
  EXPECT_GT(impossible, 200);
  PlausibilityTally counts;
  tally(*reversal, samples, counts);
  EXPECT_EQ(counts.impossible, static_cast<std::uint64_t>(impossible));
  EXPECT_FALSE(counts.plausible());
  // And one that never gives an impossible count is plausible.
  PlausibilityTally good;
  tally(*Reversal::make(affected(), 256, RecordWidth::bits12), samples, good);
  EXPECT_TRUE(good.plausible());
  EXPECT_EQ(good.counts, samples.size() * 3);
}

TEST(Reversal, ClippedCountsAreNotLookedAt) {
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  ASSERT_OK(reversal);
  PlausibilityTally counts;
  tally(*reversal, {}, counts);
  EXPECT_EQ(counts.counts, 0U);
  const std::vector<StoredCounts> inside = {{2046, -2047, 0}, {0, 0, 0}};
  tally(*reversal, inside, counts);
  EXPECT_EQ(counts.counts, 6U);
  // At the limits, and beyond them as only wider records can be.
  const std::vector<StoredCounts> some_clipped = {{2047, 0, 0}, {0, -2048, 5}, {30000, -30000, 1}};
  tally(*reversal, some_clipped, counts);
  EXPECT_EQ(counts.counts, 6U + 5U);
  EXPECT_EQ(counts.impossible, 0U);
}

TEST(Reversal, AcceptsEitherSideOfAnExactHalf) {
  // 2 * 768 / 1024 = 1.5 stored counts per raw count, so that every odd raw count is a half.
  const StoredConstants stored{{512, 256, 256}, {-512, -256, -256}, {0, 0, 0}};
  const auto reversal = Reversal::make(stored, 768, RecordWidth::bits12);
  ASSERT_OK(reversal);
  // raw 1 -> 1.5 -> 2; 1 is reached only when the firmware rounds that half down.
  EXPECT_EQ(reversal->candidates(0, 2).first, 1);
  EXPECT_FALSE(reversal->candidates(0, 2).tie);
  EXPECT_EQ(reversal->candidates(0, 1).first, 1);
  EXPECT_TRUE(reversal->candidates(0, 1).tie);
  EXPECT_EQ(reversal->candidates(0, -1).first, -1);
  EXPECT_TRUE(reversal->candidates(0, -1).tie);
}

TEST(Rescale, UnchangedConstantsChangeNothing) {
  for (const StoredConstants& stored : {affected(), steep(), half()}) {
    for (const double scale : {256.0, 341.0, 1000.0}) {
      for (const RecordWidth width : {RecordWidth::bits12, RecordWidth::bits16}) {
        const auto reversal = Reversal::make(stored, scale, width);
        ASSERT_OK(reversal);
        const auto rescale = Rescale::make(*reversal, *calibration_from(stored), {.output = width});
        ASSERT_OK(rescale);
        for (int count = lowest_count(width); count <= highest_count(width); ++count) {
          for (std::size_t a = 0; a < kAxes; ++a) {
            ASSERT_EQ((*rescale)(a, static_cast<std::int16_t>(count)), count);
          }
        }
      }
    }
  }
}

// Even constants that differ in the last digit only move nothing but exact halves.
TEST(Rescale, NearlyUnchangedConstantsChangeNothingButHalves) {
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  Calibration nearly = *calibration_from(affected());
  for (double& sensitivity : nearly.sensitivity_g_per_lsb) {
    sensitivity *= 1 + 1e-12;
  }
  const auto rescale = Rescale::make(*reversal, nearly, {});
  ASSERT_OK(rescale);
  for (int count = -2048; count <= 2047; ++count) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      ASSERT_EQ((*rescale)(a, static_cast<std::int16_t>(count)), count);
    }
  }
}

// Oracle: the tests' own forward model run with the true constants on the same raw counts. Exact
// wherever one candidate exists; within the pair's half count where there are two.
TEST(Rescale, EqualsWhatTheFirmwareWouldHaveStored) {
  const StoredConstants old = affected();
  const StoredConstants fresh{{290, 350, 300}, {-186, -154, -185}, {50, 96, 61}};
  const auto reversal = Reversal::make(old, 256, RecordWidth::bits12);
  const auto rescale = Rescale::make(*reversal, *calibration_from(fresh), {});
  ASSERT_OK(rescale);
  int exact = 0;
  for (int raw = -1500; raw <= 1500; ++raw) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto before = firmware_count(old, 256, a, raw);
      const auto wanted = firmware_count(fresh, 256, a, raw);
      const auto got = (*rescale)(a, before);
      if (reversal->candidates(a, before).number == 1) {
        ASSERT_EQ(got, wanted) << "raw " << raw << " axis " << a;
        ++exact;
      } else {
        ASSERT_NEAR(got, wanted, 1);
      }
    }
  }
  EXPECT_GT(exact, 8000);
}

// Oracle: Eq. 4-6 and the three rows of the matrix, written out; the rounding is within half a
// count.
// docs/repair.md, "What changes": where two integers share a stored count, their middle is taken. So
// the new count is at most half a sensor count, and its own rounding, from what either makes.
TEST(Rescale, TwoIntegersOfOneCountAreTakenByTheirMiddle) {
  const auto fresh = calibration_from({{260, 305, 320}, {-250, -221, -240}, {20, 47, 30}});
  ASSERT_OK(fresh);
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  ASSERT_OK(reversal);
  const auto rescale = Rescale::make(*reversal, *fresh, {});
  ASSERT_OK(rescale);
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double count_per_lsb = fresh->sensitivity_g_per_lsb[a] * 256;
    int pairs = 0;
    for (int stored = -1500; stored <= 1500; ++stored) {
      const RawCandidates found = reversal->candidates(a, stored);
      if (found.number < 2) {
        continue;
      }
      ++pairs;
      ASSERT_EQ(found.number, 2);
      const double lower = count_per_lsb * (found.first - fresh->zero_lsb[a]);
      const double upper = lower + count_per_lsb;
      const int made = (*rescale)(a, static_cast<std::int16_t>(stored));
      ASSERT_NEAR(made, (lower + upper) / 2, 0.5 + 1e-9) << stored;
      ASSERT_NEAR(made, lower, count_per_lsb / 2 + 0.5 + 1e-9) << stored;
      ASSERT_NEAR(made, upper, count_per_lsb / 2 + 0.5 + 1e-9) << stored;
    }
    EXPECT_GT(pairs, 0) << "axis " << a;
  }
}

TEST(Rescale, CrossAxisTermsAreAppliedToTheIntegersInOneRounding) {
  const StoredConstants old = affected();
  const Calibration fresh = {{1 / 240.0, 1 / 251.0, 1 / 246.0}, {50.3, 95.6, 61.4}};
  const PerAxis<double> terms = {-0.0190, -0.0003, 0.0079};
  const auto reversal = Reversal::make(old, 256, RecordWidth::bits12);
  Rescale::Options options;
  options.cross_axis = terms;
  const auto rescale = Rescale::make(*reversal, fresh, options);
  ASSERT_OK(rescale);
  std::mt19937_64 random(5);
  std::uniform_int_distribution<int> anywhere(-700, 700);
  int exact = 0;
  for (int i = 0; i < 20'000; ++i) {
    const PerAxis<int> raw = {anywhere(random), anywhere(random), anywhere(random)};
    StoredCounts in{};
    bool sure = true;
    PerAxis<double> u{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      in[a] = firmware_count(old, 256, a, raw[a]);
      sure = sure && reversal->candidates(a, in[a]).number == 1;
      u[a] = (raw[a] - fresh.zero_lsb[a]) * fresh.sensitivity_g_per_lsb[a];
    }
    const PerAxis<double> wanted_g = {u[0] + terms[0] * u[1] + terms[1] * u[2],
                                      terms[0] * u[0] + u[1] + terms[2] * u[2],
                                      terms[1] * u[0] + terms[2] * u[1] + u[2]};
    StoredCounts out{};
    RescaleTally counts;
    rescale->apply(std::span(&in, 1), std::span(&out, 1), counts);
    for (std::size_t a = 0; a < kAxes && sure; ++a) {
      ASSERT_LE(std::abs(out[a] - 256 * wanted_g[a]), 0.5 + 1e-9) << i;
      ++exact;
    }
  }
  EXPECT_GT(exact, 20'000);
  // No terms: the table of the six constants.
  options.cross_axis = {};
  const StoredCounts in = {100, -200, 250};
  StoredCounts out{};
  RescaleTally counts;
  Rescale::make(*reversal, fresh, options)->apply(std::span(&in, 1), std::span(&out, 1), counts);
  StoredCounts plain{};
  Rescale::make(*reversal, fresh, {})->apply(std::span(&in, 1), std::span(&plain, 1), counts);
  EXPECT_EQ(out, plain);
  options.cross_axis[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FAILS(Rescale::make(*reversal, fresh, options), ErrorCode::bad_data);
}

TEST(Rescale, WithCrossAxisTermsAClippedCountStaysAndOthersAreClippedOnTheirOwn) {
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  const Calibration same = *calibration_from(affected());
  Rescale::Options options;
  options.cross_axis = {0.1, 0, 0};
  const std::vector<StoredCounts> in = {{2047, 100, 0}, {2000, 1500, 0}, {-2048, -2048, -2048}};
  std::vector<StoredCounts> out(in.size());
  RescaleTally counts;
  Rescale::make(*reversal, same, options)->apply(in, out, counts);
  EXPECT_EQ(out[0][0], 2047);
  EXPECT_NEAR(out[0][1], 100 + 0.1 * 2047, 1.5);
  EXPECT_EQ(out[1][0], 2047);  // 2000 + 150
  EXPECT_EQ(out[2], in[2]);
  EXPECT_EQ(counts.clipped_before, (PerAxis<std::uint64_t>{2, 1, 1}));
  EXPECT_EQ(counts.clipped_after, (PerAxis<std::uint64_t>{1, 0, 0}));
  options.output = RecordWidth::bits16;
  RescaleTally wide;
  Rescale::make(*reversal, same, options)->apply(in, out, wide);
  EXPECT_NEAR(out[1][0], 2150, 2);
  EXPECT_EQ(wide.clipped_after, (PerAxis<std::uint64_t>{0, 0, 0}));
}

TEST(Rescale, ClippedStaysAtTheLimitAndIsCounted) {
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  const auto scaled = [](double factor) {
    Calibration made = *calibration_from(affected());
    for (double& sensitivity : made.sensitivity_g_per_lsb) {
      sensitivity *= factor;
    }
    return made;
  };
  const Calibration stronger = scaled(1.2);
  const std::vector<StoredCounts> in = {{2047, -2048, 0}, {1900, -1900, 10}, {100, 100, 100}};
  std::vector<StoredCounts> out(in.size());
  RescaleTally counts;
  Rescale::make(*reversal, stronger, {})->apply(in, out, counts);
  EXPECT_EQ(out[0][0], 2047);
  EXPECT_EQ(out[0][1], -2048);
  EXPECT_EQ(out[1][0], 2047);
  EXPECT_EQ(out[1][1], -2048);
  EXPECT_EQ(counts.samples, 3U);
  EXPECT_EQ(counts.clipped_before, (PerAxis<std::uint64_t>{1, 1, 0}));
  EXPECT_EQ(counts.clipped_after, (PerAxis<std::uint64_t>{1, 1, 0}));
  // Also where the new constants would bring it below the limit: the sensor may have felt any more.
  RescaleTally below;
  Rescale::make(*reversal, scaled(0.8), {})->apply(in, out, below);
  EXPECT_EQ(out[0][0], 2047);
  EXPECT_EQ(out[0][1], -2048);
  EXPECT_LT(out[1][0], 1700);
  EXPECT_GT(out[1][1], -1700);
  EXPECT_EQ(below.clipped_before, (PerAxis<std::uint64_t>{1, 1, 0}));
  // Wide records have room for them.
  RescaleTally wide;
  Rescale::make(*reversal, stronger, {.output = RecordWidth::bits16})->apply(in, out, wide);
  EXPECT_GT(out[0][0], 2400);
  EXPECT_LT(out[1][1], -2200);
  EXPECT_EQ(wide.clipped_before, (PerAxis<std::uint64_t>{1, 1, 0}));
  EXPECT_EQ(wide.clipped_after, (PerAxis<std::uint64_t>{0, 0, 0}));
}

// Counts beyond 12 bits count as the limit; `in` may be `out`.
TEST(Rescale, CountsBeyondTheRecordAreItsLimit) {
  const auto reversal = Reversal::make(affected(), 256, RecordWidth::bits12);
  Calibration fresh = *calibration_from(affected());
  fresh.zero_lsb[0] += 12;
  fresh.sensitivity_g_per_lsb[1] *= 1.01;
  const auto rescale = Rescale::make(*reversal, fresh, {});
  ASSERT_OK(rescale);
  std::vector<StoredCounts> samples;
  for (int count = -32768; count <= 32767; ++count) {
    const auto value = static_cast<std::int16_t>(count);
    samples.push_back({value, static_cast<std::int16_t>(-(count + 1)), 7});
  }
  const std::vector<StoredCounts> in = samples;
  RescaleTally counts;
  rescale->apply(samples, samples, counts);
  constexpr std::uint64_t kAtLimit = 65536 - 4094;
  EXPECT_EQ(counts.clipped_before, (PerAxis<std::uint64_t>{kAtLimit, kAtLimit, 0}));
  for (std::size_t i = 0; i < in.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const std::int16_t was = in[i][a];
      const std::int16_t wanted = was <= -2048  ? std::int16_t{-2048}
                                  : was >= 2047 ? std::int16_t{2047}
                                                : (*rescale)(a, was);
      ASSERT_EQ(samples[i][a], wanted) << "count " << was << " axis " << a;
    }
  }
}

TEST(Scaling, HostileConstants) {
  StoredConstants equal = affected();
  equal.negative_lsb[1] = equal.positive_lsb[1];
  EXPECT_FAILS(calibration_from(equal), ErrorCode::bad_data);
  EXPECT_FAILS(Reversal::make(equal, 256, RecordWidth::bits12), ErrorCode::bad_data);
  StoredConstants turned = affected();
  std::swap(turned.positive_lsb, turned.negative_lsb);
  EXPECT_FAILS(calibration_from(turned), ErrorCode::bad_data);
  StoredConstants wide = affected();
  wide.zero_lsb[2] = 40'000;
  EXPECT_FAILS(calibration_from(wide), ErrorCode::bad_data);
  for (const double scale : {0.0, -256.0, std::nan(""), 1e300}) {
    EXPECT_FAILS(Reversal::make(affected(), scale, RecordWidth::bits12), ErrorCode::bad_data);
  }
  Calibration broken = *calibration_from(affected());
  broken.zero_lsb[0] = std::nan("");
  EXPECT_FAILS(validate(broken), ErrorCode::bad_data);
  broken = *calibration_from(affected());
  broken.sensitivity_g_per_lsb[2] = 0;
  EXPECT_FAILS(validate(broken), ErrorCode::bad_data);
  // The flattest slope a unit's memory can hold does no harm.
  StoredConstants flat{{2047, 2047, 2047}, {-2048, -2048, -2048}, {0, 0, 0}};
  EXPECT_OK(Reversal::make(flat, 1, RecordWidth::bits16));
}

}  // namespace
}  // namespace sixpoint::calib
