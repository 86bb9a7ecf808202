// Where unpacking of a deflated entry can begin: an index of its pieces, kept in the archive.
//
//   SyncPoints points;
//   points.packed_sizes = {410'233, 398'114, 12'071};  // the third piece is the last
//   const Bytes field = to_extra_field(points);
//   parse_sync_points(std::span(field).subspan(4), {2'200'000, 820'418});  // the same again
//
// It stands in the extra field of the entry in the archive's central directory, under an ID of our
// own (0x5053, "SP"), which other readers pass over (APPNOTE 4.5). All numbers are little-endian:
//
//     2 bytes  ID, 0x5053
//     2 bytes  size of what follows
//     1 byte   version, 1
//     4 bytes  unpacked bytes of every piece but the last, which has the rest
//     4 bytes  packed bytes of the first piece
//     4 bytes  ... of the second, and so on to the last
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/bytes.h"
#include "gt3x/container/piece_packer.h"

namespace sixpoint::gt3x {

inline constexpr std::uint16_t kSyncPointsId = 0x5053;

struct SyncPoints {
  std::uint32_t piece_size = kPackedPieceSize;
  std::vector<std::uint32_t> packed_sizes;  // empty: no index
};

struct EntrySizes {
  std::uint64_t bytes = 0;
  std::uint64_t packed = 0;
};

// With ID and size. Empty where there is nothing to say (one piece), and beyond 16,000 pieces, for
// which a field has no room.
Bytes to_extra_field(const SyncPoints& points);

// `field`: what stands behind ID and size. Nothing where it does not fit the entry, or names pieces
// larger than 4 MiB: the entry is then unpacked from its beginning.
std::optional<SyncPoints> parse_sync_points(std::span<const std::uint8_t> field, EntrySizes entry);

}  // namespace sixpoint::gt3x
