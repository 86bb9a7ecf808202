#include "gt3x/log/samples.h"

#include <algorithm>

namespace sixpoint::gt3x {
namespace {

// Which axis stands first, second and third on disk.
constexpr PerAxis<std::size_t> kActivityOrder = {1, 0, 2};
constexpr PerAxis<std::size_t> kActivity3Order = {0, 1, 2};

void pack12(Bytes& payload, std::span<const Counts> samples, const PerAxis<std::size_t>& order) {
  bool half = false;  // the last byte of the payload has four bits to spare
  for (const Counts& sample : samples) {
    for (const std::size_t axis : order) {
      const auto value = static_cast<std::uint16_t>(std::clamp(sample[axis], kMin12, kMax12));
      const unsigned bits = value & 0xFFFU;
      if (half) {
        payload.back() = static_cast<std::uint8_t>(payload.back() | (bits >> 8));
        payload.push_back(static_cast<std::uint8_t>(bits));
      } else {
        payload.push_back(static_cast<std::uint8_t>(bits >> 4));
        payload.push_back(static_cast<std::uint8_t>((bits & 0xFU) << 4));
      }
      half = !half;
    }
  }
}

std::int16_t extend12(unsigned bits) {
  return static_cast<std::int16_t>(static_cast<int>(bits ^ 0x800U) - 0x800);
}

void unpack12(std::span<const std::uint8_t> payload, std::vector<Counts>& samples,
              const PerAxis<std::size_t>& order) {
  const std::size_t count = payload.size() * 2 / 9;  // nine nibbles to a sample
  samples.resize(count);
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

}  // namespace

void append_activity(Bytes& payload, std::span<const Counts> samples) {
  pack12(payload, samples, kActivityOrder);
}

void append_activity3(Bytes& payload, std::span<const Counts> samples) {
  pack12(payload, samples, kActivity3Order);
}

void append_activity2(Bytes& payload, std::span<const Counts> samples) {
  for (const Counts& sample : samples) {
    for (const std::int16_t value : sample) {
      const auto bits = static_cast<std::uint16_t>(value);
      payload.push_back(static_cast<std::uint8_t>(bits));
      payload.push_back(static_cast<std::uint8_t>(bits >> 8));
    }
  }
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
