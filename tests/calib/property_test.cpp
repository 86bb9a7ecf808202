// Properties that hold whatever the poses, the noise, the coverage and the faults.
#include <algorithm>
#include <random>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "calib/scaling.h"
#include "calib/solve.h"
#include "synthetic_unit.h"

namespace sixpoint::calib {
namespace {

using tests::firmware_count;
using tests::SyntheticUnit;
using tests::Vector;

const std::array<Vector, 6> kSideDirections = {
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
const std::array<const char*, 6> kNames = {"+x", "-x", "+y", "-y", "+z", "-z"};

StoredConstants any_constants() {
  StoredConstants stored;
  for (std::size_t a = 0; a < 3; ++a) {
    stored.negative_lsb[a] = *rc::gen::inRange(-400, -100);
    stored.positive_lsb[a] = *rc::gen::inRange(100, 400);
    stored.zero_lsb[a] = *rc::gen::inRange(-150, 150);
  }
  return stored;
}

RC_GTEST_PROP(Properties, ReversalRoundTrips, ()) {
  const StoredConstants stored = any_constants();
  const double scale = *rc::gen::element(256.0, 341.0, 300.0, 333.5);
  const auto reversal = Reversal::make(stored, scale, RecordWidth::bits12);
  RC_ASSERT(reversal.has_value());
  const auto raw = *rc::gen::inRange(-1500, 1500);
  for (std::size_t a = 0; a < 3; ++a) {
    const auto count = firmware_count(stored, scale, a, raw);
    if (reversal->clipped(count)) {
      continue;
    }
    const RawCandidates found = reversal->candidates(a, count);
    RC_ASSERT(found.number >= 1);
    RC_ASSERT(found.first <= raw);
    RC_ASSERT(raw < found.first + found.number);
    for (int k = 0; k < found.number; ++k) {
      RC_ASSERT(firmware_count(stored, scale, a, found.first + k) == count);
    }
  }
}

RC_GTEST_PROP(Properties, RescalingIsMonotonic, ()) {
  const auto reversal = Reversal::make(any_constants(), 256, RecordWidth::bits12);
  const auto fresh = calibration_from(any_constants());
  RC_ASSERT(reversal.has_value());
  RC_ASSERT(fresh.has_value());
  const auto rescale = Rescale::make(*reversal, *fresh, {});
  RC_ASSERT(rescale.has_value());
  for (std::size_t a = 0; a < 3; ++a) {
    int before = -2048;
    for (int count = -2047; count < 2047; ++count) {
      const int now = (*rescale)(a, static_cast<std::int16_t>(count));
      RC_ASSERT(now >= before);
      before = now;
    }
  }
}

StillBlock block_of(const SyntheticUnit& unit, const Calibration& stored, const Vector& up,
                    double time_s, double noise_mg, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0, noise_mg / 1000 / std::sqrt(120.0));
  StillBlock block;
  block.start_time_s = time_s;
  block.samples = 120;
  for (std::size_t a = 0; a < 3; ++a) {
    block.mean_lsb[a] =
        unit.zero_counts[a] + unit.counts_per_g[a] * (up[a] + (noise_mg > 0 ? noise(random) : 0));
    block.mean_g[a] = stored.to_g(a, block.mean_lsb[a]);
    block.sd_lsb[a] = noise_mg / 1000 * unit.counts_per_g[a];
  }
  return block;
}

// Every subset of the six sides, with any noise, any wobble, some of it faulty.
RC_GTEST_PROP(Properties, NeverWrongAndVerified, ()) {
  SyntheticUnit unit;
  const auto seed = *rc::gen::arbitrary<std::uint32_t>();
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> spread(-1, 1);
  for (std::size_t a = 0; a < 3; ++a) {
    unit.counts_per_g[a] = 225 + 15 * spread(random);
    unit.zero_counts[a] = unit.zero[a] + 40 * spread(random);
  }
  const Calibration stored = *calibration_from({unit.positive, unit.negative, unit.zero});
  const auto sides = *rc::gen::inRange(0, 64);
  const auto noise_mg = *rc::gen::inRange(0, 8);
  const auto wobble_deg = *rc::gen::inRange(0, 12);
  const auto repeats = *rc::gen::inRange(1, 12);
  const auto more = *rc::gen::inRange(0, 20);
  std::vector<StillBlock> blocks;
  double time = 0;
  const auto rest = [&](const Vector& up) {
    for (int i = 0; i < repeats; ++i, time += 4) {
      blocks.push_back(block_of(unit, stored, up, time, noise_mg, random));
    }
  };
  for (unsigned side = 0; side < 6; ++side) {
    if ((sides >> side & 1) != 0) {
      rest(wobble_deg > 0 ? tests::wobbled(kSideDirections[side], wobble_deg, random)
                          : kSideDirections[side]);
    }
  }
  const bool all_sides = sides == 63;
  for (int i = 0; all_sides && i < more; ++i) {
    rest(tests::random_direction(random));
  }
  const auto report = solve_from_still_blocks(blocks, stored);
  RC_ASSERT(report.has_value());
  const auto& missing = report->verification.missing_directions;
  if (!all_sides) {
    RC_ASSERT(!report->verification.verified);
    RC_ASSERT(!report->calibration.has_value());
    // The wobble stays below 12 degrees and the mismatch below 0.17 g: no side passes for another.
    for (unsigned side = 0; side < 6; ++side) {
      const bool named = std::find(missing.begin(), missing.end(), kNames[side]) != missing.end();
      RC_ASSERT(named == ((sides >> side & 1) == 0) || wobble_deg > 6);
    }
    return;
  }
  RC_ASSERT(missing.empty());
  RC_ASSERT(report->calibration.has_value());
  Calibration truth;
  for (std::size_t a = 0; a < 3; ++a) {
    truth.sensitivity_g_per_lsb[a] = 1 / unit.counts_per_g[a];
    truth.zero_lsb[a] = unit.zero_counts[a];
  }
  const double off_mg = difference_over_sphere(truth, *report->calibration).worst_mg;
  RC_ASSERT(!report->verification.verified || off_mg < 5);
  // Good data are not refused.
  RC_ASSERT(report->verification.verified || repeats < 4);
}

// Any numbers at all: an answer, never a crash, and never a verdict on nonsense.
RC_GTEST_PROP(Properties, AnyNumbersAreSurvived, ()) {
  const auto numbers = *rc::gen::container<std::vector<double>>(
      rc::gen::oneOf(rc::gen::arbitrary<double>(),
                     rc::gen::element(0.0, 1e300, -1e300, 1e-300, HUGE_VAL, std::nan(""))));
  std::vector<StillBlock> blocks;
  for (std::size_t i = 0; i + 3 <= numbers.size(); i += 3) {
    StillBlock block;
    block.samples = 120;
    for (std::size_t a = 0; a < 3; ++a) {
      block.mean_lsb[a] = numbers[i + a];
      block.mean_g[a] = numbers[i + (a + 1) % 3];
    }
    blocks.push_back(block);
  }
  const Calibration stored = {{0.004, 0.004, 0.004}, {0, 0, 0}};
  const auto report = solve_from_still_blocks(blocks, stored);
  if (report) {
    RC_ASSERT(!report->verification.verified);
  }
}

}  // namespace
}  // namespace sixpoint::calib
