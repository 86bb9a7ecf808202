#include "repair/compare/trace.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "repair/made_agdc.h"

namespace sixpoint::repair {
namespace {

// Catmull-Rom gives every parabola exactly.
TEST(Trace, InterpolatesAParabolaExactly) {
  std::vector<float> values;
  for (int i = 0; i < 8; ++i) {
    values.push_back(static_cast<float>(i * i));
  }
  const Trace trace = Trace::from_magnitudes("a", 100, 2, values);
  EXPECT_EQ(trace.end_s(), 104);
  EXPECT_NEAR(trace.at(101.25), 2.5 * 2.5, 1e-12);
  EXPECT_NEAR(trace.at(102), 16, 1e-12);
  EXPECT_TRUE(std::isnan(trace.at(100.25))) << "no sample before the first";
  EXPECT_TRUE(std::isnan(trace.at(99)));
  EXPECT_TRUE(std::isnan(trace.at(103.5)));
}

TEST(Trace, ASecondHasItsExtremesAndItsDeviation) {
  std::vector<float> values;
  for (int i = 0; i < 40; ++i) {
    values.push_back(i % 2 == 0 ? 0.75F : 1.25F);
  }
  values[21] = std::nanf("");
  Trace trace = Trace::from_magnitudes("a", 1000, 20, values);
  const Second first = second_at(trace, 1000);
  EXPECT_EQ(first.smallest_g, 0.75F);
  EXPECT_EQ(first.largest_g, 1.25F);
  EXPECT_NEAR(first.sd_g, 0.25, 1e-6) << "half of the samples at either side of the mean";
  for (const double step_s : {-0.02, -1e-5, 1e-5, 0.02}) {
    EXPECT_EQ(second_at(trace, 1000.5 + step_s).smallest_g, second_at(trace, 1000.5).smallest_g);
    EXPECT_EQ(second_at(trace, 1000.5 + step_s).sd_g, second_at(trace, 1000.5).sd_g)
        << "the nearest sample begins it, whichever side of it the moment is";
  }
  EXPECT_FALSE(std::isnan(second_at(trace, 1001).sd_g)) << "one of twenty is missing";
  EXPECT_TRUE(std::isnan(second_at(trace, 1001.5).sd_g)) << "beyond the end";
  for (std::size_t i = 20; i < 31; ++i) {
    values[i] = std::nanf("");
  }
  trace = Trace::from_magnitudes("a", 1000, 20, values);
  EXPECT_TRUE(std::isnan(second_at(trace, 1001).sd_g)) << "more than half are missing";
}

TEST(Trace, AnAgdcIsTakenWhereItsSamplesAreInG) {
  MemoryEnv memory;
  tests::MadeAgdc made;
  ASSERT_OK(made.write(memory.files, "a.agdc"));
  EXPECT_FAILS(Trace::load(memory.files, "a.agdc"), ErrorCode::bad_data);
  made.calibrated = true;
  made.coefficients = false;
  ASSERT_OK(made.write(memory.files, "a.agdc"));
  const auto trace = Trace::load(memory.files, "a.agdc");
  ASSERT_OK(trace);
  EXPECT_EQ(trace->size(), 240U * 32);
  EXPECT_NEAR(trace->magnitude_g(100), 1, 0.02);
}

Result<Trace> loaded(std::initializer_list<std::uint32_t> seconds) {
  Bytes log;
  for (const std::uint32_t second : seconds) {
    gt3x::tests::append_second(log, second);
  }
  MemoryEnv memory;
  SIXPOINT_CHECK(gt3x::tests::put_recording(memory.files, "f", log));
  return Trace::load(memory.files, "f");
}

// A clock that leaps ahead by hours and back again.
TEST(Trace, NoSampleIsLostWhereTheClockLeapsBack) {
  const auto trace = loaded({0, 1, 20'000, 20'001, 2, 3});
  ASSERT_OK(trace);
  ASSERT_EQ(trace->size(), 20'002U * 30);
  for (const std::size_t second : {0U, 3U, 20'000U, 20'001U}) {
    EXPECT_FALSE(std::isnan(trace->magnitude_g(30 * second))) << second;
  }
}

// A clock that was ahead at first, by hours and by less, and is set right. Oracle: the recording
// whose clock was right.
TEST(Trace, NoSampleIsLostBeforeTheFirst) {
  const auto right = loaded({0, 1, 2, 500, 7200, 7201, 20'000});
  const auto set_back = loaded({20'000, 7200, 7201, 0, 1, 2, 500});
  ASSERT_OK(right);
  ASSERT_OK(set_back);
  EXPECT_EQ(set_back->start_s(), gt3x::tests::kStart);
  ASSERT_EQ(set_back->size(), right->size());
  for (std::size_t i = 0; i < right->size(); ++i) {
    const float expected = right->magnitude_g(i);
    const float found = set_back->magnitude_g(i);
    ASSERT_TRUE(found == expected || (std::isnan(found) && std::isnan(expected))) << i;
  }
}

// Room before the first step is made for more than is needed, and given back.
TEST(Trace, AClockThatIsSetBackAgainAndAgainBeginsWhereItsEarliestSampleIs) {
  for (const std::uint32_t earliest : {100U, 3U, 0U}) {
    const auto trace = loaded({200, 201, 150, 149, 148, 147, earliest, 210});
    ASSERT_OK(trace);
    EXPECT_EQ(trace->start_s(), gt3x::tests::kStart + earliest);
    ASSERT_EQ(trace->size(), (211 - earliest) * 30);
    for (const std::uint32_t second : {200U, 201U, 150U, 149U, 148U, 147U, earliest, 210U}) {
      EXPECT_FALSE(std::isnan(trace->magnitude_g(30 * (second - earliest)))) << second;
    }
    EXPECT_TRUE(std::isnan(trace->magnitude_g(30 * (202 - earliest))));
  }
}

// Years are no reason to hold a step for each of their samples.
TEST(Trace, AClockThatIsSetBackByYearsIsRefused) {
  constexpr std::uint32_t kTenYears_s = 10U * 365 * 86'400;
  EXPECT_FAILS(loaded({kTenYears_s, 0, 1}), ErrorCode::bad_data);
  EXPECT_FAILS(loaded({0, 1, kTenYears_s}), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
