#include "gt3x/container/piece_packer.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "gt3x/container/zlib_inflated.h"

namespace sixpoint::gt3x {
namespace {

// Bytes that pack, and those that do not.
Bytes piece_of(std::size_t size, std::uint64_t kinds) {
  Random random(size + kinds);
  Bytes bytes(size);
  for (auto& byte : bytes) {
    byte = static_cast<std::uint8_t>(random.below(kinds));
  }
  return bytes;
}

// Oracle: zlib reads the joined stream.
TEST(PiecePacker, PiecesJoinToOneStreamAndUnpackAlone) {
  PiecePacker packer;
  for (const std::uint64_t kinds : {1U, 3U, 40U, 255U, 256U}) {
    Bytes all;
    Bytes stream;
    const std::vector<std::size_t> sizes = {0, 1, 10, 4999, 70'000, 400'000, 3};
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const auto place =
          i + 1 < sizes.size() ? PiecePacker::Place::inner : PiecePacker::Place::last;
      const Bytes piece = piece_of(sizes[i], kinds);
      Bytes packed;
      packer.pack(piece, place, packed);
      stream.insert(stream.end(), packed.begin(), packed.end());
      all.insert(all.end(), piece.begin(), piece.end());

      Bytes back(piece.size());
      Bytes longer(piece.size() + 1);
      const Bytes kept = packed;
      EXPECT_TRUE(unpack_piece(packed, place, back)) << kinds << " " << sizes[i];
      EXPECT_EQ(back, piece);
      packed = kept;
      EXPECT_FALSE(unpack_piece(packed, place, longer));
      packed = kept;
      packed.push_back(0);
      EXPECT_FALSE(unpack_piece(packed, place, back)) << "a byte too many";
    }
    EXPECT_EQ(inflated_by_zlib(stream, all.size(), kRawStream), all) << kinds;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
