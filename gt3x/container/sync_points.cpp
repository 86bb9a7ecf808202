#include "gt3x/container/sync_points.h"

#include <numeric>

namespace sixpoint::gt3x {
namespace {

constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kHeadSize = 5;  // version and piece size
constexpr std::size_t kMostPieces = 16'000;
constexpr std::uint32_t kLargestPieceSize = std::uint32_t{4} << 20;

void put(Bytes& out, std::uint64_t value, unsigned bytes) {
  for (unsigned i = 0; i < bytes; ++i) {
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
}

std::uint32_t number_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value |= static_cast<std::uint32_t>(bytes[at + i]) << (8 * i);
  }
  return value;
}

}  // namespace

Bytes to_extra_field(const SyncPoints& points) {
  const std::size_t count = points.packed_sizes.size();
  if (count < 2 || count > kMostPieces) {
    return {};
  }
  Bytes out;
  put(out, kSyncPointsId, 2);
  put(out, kHeadSize + 4 * count, 2);
  put(out, kVersion, 1);
  put(out, points.piece_size, 4);
  for (const std::uint32_t size : points.packed_sizes) {
    put(out, size, 4);
  }
  return out;
}

std::optional<SyncPoints> parse_sync_points(std::span<const std::uint8_t> field, EntrySizes entry) {
  if (field.size() < kHeadSize || (field.size() - kHeadSize) % 4 != 0 || field[0] != kVersion) {
    return std::nullopt;
  }
  SyncPoints points;
  points.piece_size = number_at(field, 1);
  const std::size_t count = (field.size() - kHeadSize) / 4;
  if (points.piece_size == 0 || points.piece_size > kLargestPieceSize || count == 0 ||
      count != (entry.bytes + points.piece_size - 1) / points.piece_size) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < count; ++i) {
    points.packed_sizes.push_back(number_at(field, kHeadSize + 4 * i));
    // Packing adds at most a few bytes in a thousand.
    if (points.packed_sizes.back() > 2 * std::uint64_t{points.piece_size} + 100) {
      return std::nullopt;
    }
  }
  const std::uint64_t sum =
      std::accumulate(points.packed_sizes.begin(), points.packed_sizes.end(), std::uint64_t{0});
  return sum == entry.packed ? std::optional(std::move(points)) : std::nullopt;
}

}  // namespace sixpoint::gt3x
