#include "gt3x/log/samples.h"

#include <algorithm>
#include <array>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace sixpoint::gt3x {
namespace {

// Which axis stands first, second and third on disk.
constexpr PerAxis<std::size_t> kActivityOrder = {1, 0, 2};
constexpr PerAxis<std::size_t> kActivity3Order = {0, 1, 2};

// One value after the other: what every other way is tested against.
void pack12_plain(std::uint8_t* payload, std::span<const Counts> samples,
                  const PerAxis<std::size_t>& order) {
  bool half = false;  // the byte at `payload` has four bits to spare
  for (const Counts& sample : samples) {
    for (const std::size_t axis : order) {
      const auto value = static_cast<std::uint16_t>(std::clamp(sample[axis], kMin12, kMax12));
      const unsigned bits = value & 0xFFFU;
      if (half) {
        *payload = static_cast<std::uint8_t>(*payload | (bits >> 8));
        ++payload;
        *payload++ = static_cast<std::uint8_t>(bits);
      } else {
        *payload++ = static_cast<std::uint8_t>(bits >> 4);
        *payload = static_cast<std::uint8_t>((bits & 0xFU) << 4);
      }
      half = !half;
    }
  }
}

std::int16_t extend12(unsigned bits) {
  return static_cast<std::int16_t>(static_cast<int>(bits ^ 0x800U) - 0x800);
}

// One value after the other, from nibble `nibble` on: what every other way is tested against.
void unpack12_plain(const std::uint8_t* payload, std::span<Counts> samples,
                    const PerAxis<std::size_t>& order) {
  std::size_t nibble = 0;
  for (Counts& sample : samples) {
    for (const std::size_t axis : order) {
      const std::size_t byte = nibble / 2;
      const unsigned bits = nibble % 2 == 0 ? (static_cast<unsigned>(payload[byte]) << 4) |
                                                  (static_cast<unsigned>(payload[byte + 1]) >> 4)
                                            : ((static_cast<unsigned>(payload[byte]) & 0xFU) << 8) |
                                                  static_cast<unsigned>(payload[byte + 1]);
      sample[axis] = extend12(bits);
      nibble += 3;
    }
  }
}

#if defined(__x86_64__)

// Eight samples are 24 values in 36 bytes. Each of three shuffles makes eight values: value v of
// the disk's order lies in bytes 3v / 2 and the one behind, which become one big-endian word; an
// even value is its upper 12 bits, an odd one its lower 12.
constexpr std::size_t kGroup = 8;
constexpr std::array<std::size_t, 3> kLoadAt = {0, 12, 20};  // 16 bytes from there hold all eight

struct Shuffles {
  alignas(16) std::array<std::array<std::uint8_t, 16>, 3> bytes;
  alignas(16) std::array<std::array<std::int16_t, 8>, 3> shift_left;  // as a factor: 1 or 16
};

constexpr Shuffles shuffles_of(const PerAxis<std::size_t>& order) {
  Shuffles made{};
  PerAxis<std::size_t> place{};  // of an axis on disk
  for (std::size_t i = 0; i < kAxes; ++i) {
    place[order[i]] = i;
  }
  for (std::size_t out = 0; out < kGroup * kAxes; ++out) {
    const std::size_t value = out / kAxes * kAxes + place[out % kAxes];
    const std::size_t part = out / 8;
    const std::size_t byte = value * 3 / 2 - kLoadAt[part];
    // Little-endian lanes: the word's upper byte is the second one.
    made.bytes[part][out % 8 * 2] = static_cast<std::uint8_t>(byte + 1);
    made.bytes[part][out % 8 * 2 + 1] = static_cast<std::uint8_t>(byte);
    made.shift_left[part][out % 8] = value % 2 == 0 ? 1 : 16;
  }
  return made;
}
constexpr Shuffles kActivityShuffles = shuffles_of(kActivityOrder);
constexpr Shuffles kActivity3Shuffles = shuffles_of(kActivity3Order);

// Whole groups, and one that ends with the last pair; returns how many samples.
[[gnu::target("ssse3")]] std::size_t unpack12_ssse3(std::span<const std::uint8_t> payload,
                                                    std::span<Counts> samples,
                                                    const Shuffles& shuffles) {
  const auto load = [](const void* at) { return _mm_loadu_si128(static_cast<const __m128i*>(at)); };
  std::size_t done = 0;
  while (done + kGroup <= samples.size()) {
    const std::uint8_t* const from = payload.data() + done * 9 / 2;
    for (std::size_t part = 0; part < 3; ++part) {
      const __m128i words =
          _mm_shuffle_epi8(load(from + kLoadAt[part]), load(shuffles.bytes[part].data()));
      const __m128i values =
          _mm_srai_epi16(_mm_mullo_epi16(words, load(shuffles.shift_left[part].data())), 4);
      _mm_storeu_si128(reinterpret_cast<__m128i*>(samples[done].data() + part * 8), values);
    }
    done += kGroup;
    // What is left is less than a group: some samples before it go through once more. An even
    // sample begins a byte.
    const std::size_t left = samples.size() - done;
    if (left > 1 && left < kGroup) {
      done -= (kGroup - left + 1) / 2 * 2;
    }
  }
  return done;
}

// Two samples are six values in nine bytes. The first shuffle puts the values into the order of the
// disk; a multiply-and-add makes 24 bits of each pair; the second shuffle sets the three bytes of
// each pair behind one another, most significant first.
constexpr std::size_t kPair = 2;
constexpr std::size_t kPairBytes = 9;

struct PackShuffles {
  alignas(16) std::array<std::uint8_t, 16> order;
  alignas(16) std::array<std::uint8_t, 16> bytes;
};

constexpr PackShuffles pack_shuffles_of(const PerAxis<std::size_t>& order) {
  PackShuffles made{};
  made.order.fill(0x80);  // zero
  made.bytes.fill(0x80);
  for (std::size_t value = 0; value < kPair * kAxes; ++value) {
    const std::size_t from = value / kAxes * kAxes + order[value % kAxes];
    made.order[value * 2] = static_cast<std::uint8_t>(from * 2);
    made.order[value * 2 + 1] = static_cast<std::uint8_t>(from * 2 + 1);
  }
  for (std::size_t i = 0; i < kPairBytes; ++i) {
    made.bytes[i] = static_cast<std::uint8_t>(i / 3 * 4 + 2 - i % 3);
  }
  return made;
}
constexpr PackShuffles kActivityPack = pack_shuffles_of(kActivityOrder);
constexpr PackShuffles kActivity3Pack = pack_shuffles_of(kActivity3Order);

// Whole pairs, as long as 16 bytes may be read and written at each; returns how many samples.
[[gnu::target("ssse3")]] std::size_t pack12_ssse3(std::span<std::uint8_t> payload,
                                                  std::span<const Counts> samples,
                                                  const PackShuffles& shuffles) {
  const auto load = [](const void* at) { return _mm_loadu_si128(static_cast<const __m128i*>(at)); };
  const __m128i order = load(shuffles.order.data());
  const __m128i bytes = load(shuffles.bytes.data());
  const __m128i lowest = _mm_set1_epi16(kMin12);
  const __m128i highest = _mm_set1_epi16(kMax12);
  const __m128i twelve_bits = _mm_set1_epi16(0xFFF);
  const __m128i upper_and_lower = _mm_set1_epi32((1 << 16) | (1 << 12));
  constexpr std::size_t kReach = 3;  // samples that 16 bytes touch
  std::size_t done = 0;
  std::uint8_t* to = payload.data();
  const std::uint8_t* const end = payload.data() + payload.size();
  for (; done + kReach <= samples.size() && end - to >= 16; done += kPair, to += kPairBytes) {
    __m128i values = _mm_shuffle_epi8(load(samples[done].data()), order);
    values = _mm_and_si128(_mm_min_epi16(_mm_max_epi16(values, lowest), highest), twelve_bits);
    const __m128i pairs = _mm_madd_epi16(values, upper_and_lower);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_shuffle_epi8(pairs, bytes));
  }
  return done;
}

#endif

void pack12(Bytes& payload, std::span<const Counts> samples, const PerAxis<std::size_t>& order) {
  const std::size_t before = payload.size();
  payload.resize(before + (samples.size() * 9 + 1) / 2);  // nine nibbles to a sample
  const auto out = std::span(payload).subspan(before);
  std::size_t done = 0;
#if defined(__x86_64__)
  static const bool has_ssse3 = __builtin_cpu_supports("ssse3") != 0;
  if (has_ssse3) {
    done = pack12_ssse3(out, samples, order == kActivityOrder ? kActivityPack : kActivity3Pack);
  }
#endif
  pack12_plain(out.data() + done * 9 / 2, samples.subspan(done), order);
}

void unpack12(std::span<const std::uint8_t> payload, std::vector<Counts>& samples,
              const PerAxis<std::size_t>& order) {
  samples.resize(payload.size() * 2 / 9);  // nine nibbles to a sample
  std::size_t done = 0;
#if defined(__x86_64__)
  static const bool has_ssse3 = __builtin_cpu_supports("ssse3") != 0;
  if (has_ssse3) {
    done = unpack12_ssse3(payload, samples,
                          order == kActivityOrder ? kActivityShuffles : kActivity3Shuffles);
  }
#endif
  unpack12_plain(payload.data() + done * 9 / 2, std::span(samples).subspan(done), order);
}

}  // namespace

void append_activity(Bytes& payload, std::span<const Counts> samples) {
  pack12(payload, samples, kActivityOrder);
}

void append_activity3(Bytes& payload, std::span<const Counts> samples) {
  pack12(payload, samples, kActivity3Order);
}

void append_activity2(Bytes& payload, std::span<const Counts> samples) {
  std::size_t at = payload.size();
  payload.resize(at + samples.size() * sizeof(Counts));
  for (const Counts& sample : samples) {
    for (const std::int16_t value : sample) {
      const auto bits = static_cast<std::uint16_t>(value);
      payload[at++] = static_cast<std::uint8_t>(bits);
      payload[at++] = static_cast<std::uint8_t>(bits >> 8);
    }
  }
}

CountRange range_of(std::span<const Counts> samples) {
  CountRange range;
  if (samples.empty()) {
    return range;
  }
  // Numbers of their own: what is returned might lie among the values, as far as the compiler
  // knows.
  const std::int16_t* const values = samples.front().data();
  std::int16_t low = range.low;
  std::int16_t high = range.high;
  for (std::size_t i = 0; i < samples.size() * kAxes; ++i) {
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
  }
  return {low, high};
}

void unpack_activity(std::span<const std::uint8_t> payload, std::vector<Counts>& samples) {
  unpack12(payload, samples, kActivityOrder);
}

void unpack_activity3(std::span<const std::uint8_t> payload, std::vector<Counts>& samples) {
  unpack12(payload, samples, kActivity3Order);
}

void unpack_activity2(std::span<const std::uint8_t> payload, std::vector<Counts>& samples) {
  constexpr std::size_t kSampleSize = kAxes * 2;
  samples.resize(payload.size() / kSampleSize);
  std::size_t at = 0;
  for (Counts& sample : samples) {
    for (std::int16_t& value : sample) {
      value = static_cast<std::int16_t>(payload[at] | (payload[at + 1] << 8));
      at += 2;
    }
  }
}

}  // namespace sixpoint::gt3x
