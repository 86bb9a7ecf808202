#include "calib/sums/split_axes.h"

#include <cstddef>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace sixpoint::calib {
namespace {

using Sample = std::array<std::int16_t, 3>;

#if defined(__x86_64__)
// Eight samples are three registers of eight counts; of each register every axis has two or three.
constexpr std::size_t kGroup = 8;
using Shuffle = std::array<std::uint8_t, 16>;

// The bytes of register `part` that go to axis `axis`, at their places; zero elsewhere.
constexpr Shuffle shuffle_of(std::size_t axis, std::size_t part) {
  Shuffle bytes{};
  for (std::size_t i = 0; i < kGroup; ++i) {
    const std::size_t value = 3 * i + axis;  // of the group's 24
    const bool here = value / kGroup == part;
    bytes[2 * i] = here ? static_cast<std::uint8_t>(value % kGroup * 2) : std::uint8_t{0x80};
    bytes[2 * i + 1] =
        here ? static_cast<std::uint8_t>(value % kGroup * 2 + 1) : std::uint8_t{0x80};
  }
  return bytes;
}
alignas(16) constexpr std::array<std::array<Shuffle, 3>, 3> kShuffles = {
    {{shuffle_of(0, 0), shuffle_of(0, 1), shuffle_of(0, 2)},
     {shuffle_of(1, 0), shuffle_of(1, 1), shuffle_of(1, 2)},
     {shuffle_of(2, 0), shuffle_of(2, 1), shuffle_of(2, 2)}}};

// Whole groups; returns how many samples.
[[gnu::target("ssse3")]] std::size_t split_ssse3(std::span<const Sample> samples,
                                                 const std::array<std::int16_t*, 3>& out) {
  const auto load = [](const void* at) { return _mm_loadu_si128(static_cast<const __m128i*>(at)); };
  std::size_t done = 0;
  for (; done + kGroup <= samples.size(); done += kGroup) {
    const std::int16_t* from = samples[done].data();
    const __m128i first = load(from);
    const __m128i second = load(from + kGroup);
    const __m128i third = load(from + 2 * kGroup);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const __m128i counts =
          _mm_or_si128(_mm_or_si128(_mm_shuffle_epi8(first, load(kShuffles[axis][0].data())),
                                    _mm_shuffle_epi8(second, load(kShuffles[axis][1].data()))),
                       _mm_shuffle_epi8(third, load(kShuffles[axis][2].data())));
      _mm_storeu_si128(reinterpret_cast<__m128i*>(out[axis] + done), counts);
    }
  }
  return done;
}
#endif

}  // namespace

void split_axes(std::span<const Sample> samples, std::int16_t* x, std::int16_t* y,
                std::int16_t* z) {
  std::size_t done = 0;
#if defined(__x86_64__)
  static const bool has_ssse3 = __builtin_cpu_supports("ssse3") != 0;
  if (has_ssse3) {
    done = split_ssse3(samples, {x, y, z});
  }
#endif
  for (; done < samples.size(); ++done) {
    x[done] = samples[done][0];
    y[done] = samples[done][1];
    z[done] = samples[done][2];
  }
}

}  // namespace sixpoint::calib
