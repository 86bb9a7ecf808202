#include "calib/sums/count_sums.h"

#include <algorithm>
#include <array>
#include <cmath>

// Written once, compiled twice: for every machine, and for those with AVX2. No wider instructions:
// sums of a few dozen counts do not become faster by them.
#if defined(__x86_64__)
#define SIXPOINT_FOR_AVX2 [[gnu::target("avx2")]]
#endif
#define SIXPOINT_INLINE [[gnu::always_inline]] inline

namespace sixpoint::calib {
namespace {

// So many counts of 16 bits, times their numbers, stay below 32 bits.
constexpr std::size_t kChunk = 32;

struct ChunkSums {
  std::int32_t sum = 0;
  std::int32_t moment = 0;
};

SIXPOINT_INLINE ChunkSums chunk_sums(const std::int16_t* counts, std::size_t size,
                                     std::int16_t& low, std::int16_t& high) {
  ChunkSums sums;
  for (std::size_t i = 0; i < size; ++i) {
    const std::int16_t count = counts[i];
    sums.sum += count;
    sums.moment += count * static_cast<std::int16_t>(i);
    low = std::min(low, count);
    high = std::max(high, count);
  }
  return sums;
}

SIXPOINT_INLINE CountSums sums_body(std::span<const std::int16_t> counts) {
  CountSums all;
  std::int16_t low = counts.front();
  std::int16_t high = counts.front();
  std::size_t begin = 0;
  const auto add = [&](const ChunkSums& sums) {
    all.sum += sums.sum;
    all.moment += sums.moment + static_cast<std::int64_t>(begin) * sums.sum;
  };
  // The compiler unrolls a chunk whose length it knows.
  for (; begin + kChunk <= counts.size(); begin += kChunk) {
    add(chunk_sums(counts.data() + begin, kChunk, low, high));
  }
  add(chunk_sums(counts.data() + begin, counts.size() - begin, low, high));
  all.low = low;
  all.high = high;
  return all;
}

SIXPOINT_INLINE std::int64_t squares_body(std::span<const std::int16_t> counts) {
  std::int64_t sum = 0;
  for (const std::int16_t count : counts) {
    const std::int32_t square = std::int32_t{count} * count;  // 32 bits: twice as many lanes
    sum += square;
  }
  return sum;
}

SIXPOINT_INLINE float residual_body(std::span<const std::int16_t> counts,
                                    std::span<const float> centred, float mean, float slope) {
  constexpr std::size_t kLanes = 8;
  std::array<float, kLanes> largest{};
  const auto take = [&](std::size_t lane, std::size_t i) {
    const float residual = std::abs(static_cast<float>(counts[i]) - (mean + slope * centred[i]));
    largest[lane] = residual > largest[lane] ? residual : largest[lane];
  };
  std::size_t i = 0;
  for (; i + kLanes <= counts.size(); i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      take(lane, i + lane);
    }
  }
  for (std::size_t lane = 0; i < counts.size(); ++i, ++lane) {
    take(lane, i);
  }
  return *std::max_element(largest.begin(), largest.end());
}

#if defined(__x86_64__)
SIXPOINT_FOR_AVX2 CountSums sums_avx2(std::span<const std::int16_t> counts) {
  return sums_body(counts);
}
SIXPOINT_FOR_AVX2 std::int64_t squares_avx2(std::span<const std::int16_t> counts) {
  return squares_body(counts);
}
SIXPOINT_FOR_AVX2 float residual_avx2(std::span<const std::int16_t> counts,
                                      std::span<const float> centred, float mean, float slope) {
  return residual_body(counts, centred, mean, slope);
}

bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
}
#endif

}  // namespace

CountSums count_sums(std::span<const std::int16_t> counts) {
#if defined(__x86_64__)
  if (has_avx2()) {
    return sums_avx2(counts);
  }
#endif
  return sums_body(counts);
}

std::int64_t sum_of_squares(std::span<const std::int16_t> counts) {
#if defined(__x86_64__)
  if (has_avx2()) {
    return squares_avx2(counts);
  }
#endif
  return squares_body(counts);
}

float largest_residual(std::span<const std::int16_t> counts, std::span<const float> centred,
                       float mean, float slope) {
#if defined(__x86_64__)
  if (has_avx2()) {
    return residual_avx2(counts, centred, mean, slope);
  }
#endif
  return residual_body(counts, centred, mean, slope);
}

}  // namespace sixpoint::calib
