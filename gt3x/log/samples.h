// Samples in the payloads of ACTIVITY, ACTIVITY2 and ACTIVITY3 records, both ways.
//
//   const std::vector<Counts> second(30, {0, 0, 256});  // 30 Hz, Z up at 256 LSB/g
//   Bytes payload;
//   append_activity(payload, second);
//   std::vector<Counts> samples;
//   unpack_activity(payload, samples);  // the same again
//
// Packed payloads (vendor's public description): 12 bits per value, most significant bit first, two
// values in three bytes; the order of the axes on disk is Y X Z in ACTIVITY and in activity.bin,
// X Y Z in ACTIVITY3. After an odd number of values the last nibble is unused. ACTIVITY2 holds
// 16-bit little-endian values in the order X Y Z. In memory the order is X Y Z everywhere.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/env.h"
#include "base/measure.h"

namespace sixpoint::gt3x {

using Counts = PerAxis<std::int16_t>;  // stored LSB

inline constexpr std::int16_t kMin12 = -2048;
inline constexpr std::int16_t kMax12 = 2047;

// Appends the payload bytes for `samples`. Values outside 12 bits are a defect of the caller, who
// clips and counts; here they are clipped.
void append_activity(Bytes& payload, std::span<const Counts> samples);
void append_activity2(Bytes& payload, std::span<const Counts> samples);
void append_activity3(Bytes& payload, std::span<const Counts> samples);

// Replaces `samples` by what the payload holds: whole samples only, what is left over at the end is
// ignored (bytes that make no whole sample are the unused nibble, or padding).
void unpack_activity(std::span<const std::uint8_t> payload, std::vector<Counts>& samples);
void unpack_activity2(std::span<const std::uint8_t> payload, std::vector<Counts>& samples);
void unpack_activity3(std::span<const std::uint8_t> payload, std::vector<Counts>& samples);

// The smallest and the largest count of all axes: whether any sample can have been clipped is seen
// from these. Without samples low is above high.
struct CountRange {
  std::int16_t low = std::numeric_limits<std::int16_t>::max();
  std::int16_t high = std::numeric_limits<std::int16_t>::min();
};
CountRange range_of(std::span<const Counts> samples);

}  // namespace sixpoint::gt3x
