#include "repair/impact/activity_counts.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "base/env.h"
#include "expect_result.h"
#include "repair/impact/epochs.h"
#include "shared_data.h"

namespace sixpoint::repair {
namespace {

// The vendor's own counts in an .agd; axis1 is the unit's Y.
std::vector<PerAxis<int>> vendor_counts(const std::string& path) {
  std::vector<PerAxis<int>> counts;
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open_v2(("file:" + path + "?immutable=1").c_str(), &database,
                            SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr),
            SQLITE_OK);
  sqlite3_stmt* rows = nullptr;
  EXPECT_EQ(
      sqlite3_prepare_v2(database, "SELECT axis1, axis2, axis3 FROM data ORDER BY dataTimestamp",
                         -1, &rows, nullptr),
      SQLITE_OK);
  while (sqlite3_step(rows) == SQLITE_ROW) {
    counts.push_back(
        {sqlite3_column_int(rows, 1), sqlite3_column_int(rows, 0), sqlite3_column_int(rows, 2)});
  }
  sqlite3_finalize(rows);
  sqlite3_close(database);
  return counts;
}

std::vector<Epoch> epochs_of_file(const std::string& path, const EpochOptions& options) {
  auto recording = gt3x::Recording::open(posix_env().files, path);
  EXPECT_OK(recording);
  auto series = epochs_of(*recording, options);
  EXPECT_OK(series);
  EXPECT_TRUE(series->has_counts);
  return series->epochs;
}

// Oracle: what ActiLife made of the same recording, 90 Hz, with the low frequency extension.
TEST(ActivityCounts, AreTheVendorsAt90Hz) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1E31150129.gt3x");
  const auto expected = vendor_counts(tests::shared_file("data/agd/example1sec.agd"));
  const auto epochs =
      epochs_of_file(tests::shared_file("data/gt9x/TAS1E31150129.gt3x"),
                     {.epoch_s = 1, .filter = CountFilter::low_frequency_extension});
  ASSERT_EQ(expected.size(), 180U);
  ASSERT_EQ(epochs.size(), expected.size());
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    EXPECT_EQ(epochs[i].counts, expected[i]) << "epoch " << i;
  }
}

// Oracle: the same, 100 Hz, normal filter. The low pass of ActiLife differs in its last digits.
TEST(ActivityCounts, AreTheVendorsAt100HzWithinThree) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1H52220588.gt3x");
  const auto expected = vendor_counts(tests::shared_file("data/agd/example5sec.agd"));
  const auto epochs = epochs_of_file(tests::shared_file("data/gt9x/TAS1H52220588.gt3x"), {});
  ASSERT_EQ(expected.size(), 36U);
  ASSERT_EQ(epochs.size(), expected.size());
  int difference = 0;
  int all = 0;
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      EXPECT_NEAR(epochs[i].counts[a], expected[i][a], 3) << "epoch " << i << ", axis " << a;
      difference += std::abs(epochs[i].counts[a] - expected[i][a]);
      all += expected[i][a];
    }
  }
  EXPECT_GT(all, 20'000);
  EXPECT_LT(difference, all / 500);
}

int total(int rate_hz, double amplitude_g, double frequency_hz) {
  ActivityCounts axis(rate_hz, 5, CountFilter::normal);
  int sum = 0;
  for (int i = 0; i < 60 * rate_hz; ++i) {
    const double phase = 2 * std::numbers::pi * frequency_hz * i / rate_hz;
    sum += axis.push(0.5 + amplitude_g * std::sin(phase)).value_or(0);
  }
  return sum;
}

TEST(ActivityCounts, RestHasNone) {
  for (const int rate_hz : {30, 40, 50, 60, 70, 80, 90, 100}) {
    EXPECT_TRUE(ActivityCounts::knows(rate_hz));
    EXPECT_EQ(total(rate_hz, 0, 1), 0) << rate_hz;
  }
  EXPECT_FALSE(ActivityCounts::knows(32));
  EXPECT_FALSE(ActivityCounts::knows(30.5));
}

// The band is 0.29 to 1.63 Hz, and the largest value at 30 Hz is 128.
TEST(ActivityCounts, ComeFromTheBandAndAreCutOff) {
  EXPECT_GT(total(30, 0.5, 0.8), 10 * total(30, 0.5, 6));
  EXPECT_GT(total(30, 0.5, 0.8), 10 * total(30, 0.5, 0.05));
  EXPECT_LE(total(30, 100, 0.8), 60 * 10 * 128);
  EXPECT_GT(total(30, 100, 0.8), 60 * 10 * 120);
}

TEST(ActivityCounts, AnEpochHasItsSeconds) {
  for (const int rate_hz : {30, 40, 90, 100}) {
    ActivityCounts axis(rate_hz, 2, CountFilter::normal);
    for (int i = 0; i < 10 * rate_hz; ++i) {
      // The last value at 30 Hz of an epoch comes before its last sample, at most 1/10 s.
      if (axis.push(1)) {
        EXPECT_GE(i % (2 * rate_hz), 2 * rate_hz - rate_hz / 10) << rate_hz;
      }
    }
  }
}

}  // namespace
}  // namespace sixpoint::repair
