#include "calib/sums/count_sums.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "calib/sums/split_axes.h"

namespace sixpoint::calib {
namespace {

std::vector<std::int16_t> counts_of(std::size_t size, std::uint64_t seed) {
  Random random(seed);
  std::vector<std::int16_t> counts(size);
  for (auto& count : counts) {
    count = static_cast<std::int16_t>(static_cast<int>(random.below(65536)) - 32768);
  }
  return counts;
}

// Oracle: the definitions, in 64 bits, one count after the other.
void expect_sums_by_definition(const std::vector<std::int16_t>& counts) {
  const CountSums sums = count_sums(counts);
  std::int64_t sum = 0;
  std::int64_t moment = 0;
  std::int64_t squares = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    sum += counts[i];
    moment += static_cast<std::int64_t>(i) * counts[i];
    squares += static_cast<std::int64_t>(counts[i]) * counts[i];
  }
  EXPECT_EQ(sums.sum, sum) << counts.size();
  EXPECT_EQ(sums.moment, moment) << counts.size();
  EXPECT_EQ(sums.low, *std::ranges::min_element(counts)) << counts.size();
  EXPECT_EQ(sums.high, *std::ranges::max_element(counts)) << counts.size();
  EXPECT_EQ(sum_of_squares(counts), squares) << counts.size();
}

TEST(CountSums, AreExactAtEveryLength) {
  for (std::size_t size = 1; size <= 130; ++size) {
    expect_sums_by_definition(counts_of(size, size));
  }
  expect_sums_by_definition(counts_of(60'000, 7));
}

TEST(CountSums, SplitAxesPutsEveryCountInItsPlace) {
  for (std::size_t size = 0; size <= 70; ++size) {
    const auto counts = counts_of(3 * size, size);
    std::vector<std::array<std::int16_t, 3>> samples(size);
    for (std::size_t i = 0; i < counts.size(); ++i) {
      samples[i / 3][i % 3] = counts[i];
    }
    constexpr std::int16_t kBehind = 77;
    std::array<std::vector<std::int16_t>, 3> axes;
    axes.fill(std::vector<std::int16_t>(size + 1, kBehind));
    split_axes(samples, axes[0].data(), axes[1].data(), axes[2].data());
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t i = 0; i < size; ++i) {
        ASSERT_EQ(axes[a][i], samples[i][a]) << size << " sample " << i << " axis " << a;
      }
      EXPECT_EQ(axes[a][size], kBehind) << "nothing is written behind";
    }
  }
}

TEST(CountSums, AreExactAtTheEndsOfTheRange) {
  for (const int count : {INT16_MIN, INT16_MAX}) {
    expect_sums_by_definition(std::vector<std::int16_t>(400, static_cast<std::int16_t>(count)));
    expect_sums_by_definition(std::vector<std::int16_t>(60'000, static_cast<std::int16_t>(count)));
  }
}

TEST(CountSums, LargestResidualIsFoundWhereverItLies) {
  for (std::size_t size = 1; size <= 40; ++size) {
    std::vector<float> centred(size);
    std::vector<std::int16_t> counts(size);
    for (std::size_t i = 0; i < size; ++i) {
      centred[i] = static_cast<float>(i) - 0.5F * static_cast<float>(size - 1);
      counts[i] = static_cast<std::int16_t>(100 + static_cast<int>(i));
    }
    const float mean = 100 + 0.5F * static_cast<float>(size - 1);
    EXPECT_EQ(largest_residual(counts, centred, mean, 1), 0) << size;
    for (std::size_t at = 0; at < size; ++at) {
      auto bent = counts;
      bent[at] = static_cast<std::int16_t>(bent[at] + (at % 2 == 0 ? 7 : -7));
      EXPECT_EQ(largest_residual(bent, centred, mean, 1), 7) << size << ", " << at;
    }
  }
}

}  // namespace
}  // namespace sixpoint::calib
