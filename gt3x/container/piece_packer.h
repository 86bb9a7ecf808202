// Packs one piece of an entry so that the pieces, one behind the other, are one deflate stream, and
// every piece can be unpacked without the others.
//
//   PiecePacker packer;
//   Bytes stream;
//   packer.pack(first, PiecePacker::Place::inner, packed);
//   stream.insert(stream.end(), packed.begin(), packed.end());
//   packer.pack(second, PiecePacker::Place::last, packed);
//   stream.insert(stream.end(), packed.begin(), packed.end());
//
// libdeflate at level 6. On logs of real units its output is 0 to 6 % smaller than zlib's at level
// 6, which the vendor uses, and takes a quarter of zlib's time. isa-l would be five times as fast
// and its output 15 % larger.
//
// An inner piece loses the mark of its last block and gets an empty stored block behind it, which
// ends at a whole byte (what zlib calls a full flush, and pigz does). One object belongs to one
// thread.
#pragma once

#include <cstdint>
#include <span>

#include "base/bytes.h"
#include "gt3x/container/deflate_blocks.h"

struct libdeflate_compressor;

namespace sixpoint::gt3x {

// Between two places where unpacking can begin.
inline constexpr std::size_t kPackedPieceSize = std::size_t{1} << 20;

class PiecePacker {
 public:
  PiecePacker();
  PiecePacker(const PiecePacker&) = delete;
  PiecePacker& operator=(const PiecePacker&) = delete;
  ~PiecePacker();

  enum class Place { inner, last };
  // Replaces `packed`. The same piece gives the same bytes.
  void pack(std::span<const std::uint8_t> piece, Place place, Bytes& packed);

 private:
  libdeflate_compressor* compressor_;
  LastBlockFinder finder_;
};

// The bytes of a piece that was packed at this place; false where `packed` is not exactly that of
// piece.size() bytes. Changes `packed`.
bool unpack_piece(Bytes& packed, PiecePacker::Place place, std::span<std::uint8_t> piece);

}  // namespace sixpoint::gt3x
