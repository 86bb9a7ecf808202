// Where the last block of a deflate stream begins, so that streams can be joined into one.
//
//   const auto last = find_last_block(stream);
//   if (last) {  // no longer the last one
//     stream[last->begin_bit / 8] ^= static_cast<std::uint8_t>(1U << (last->begin_bit % 8));
//   }
//
// The first bit of a block says whether it is the last of its stream (RFC 1951, 3.2.3). libdeflate
// makes whole streams only and does not tell where its blocks begin, so the symbols of the stream
// are walked through: their lengths alone, no byte is unpacked. That takes a tenth to a sixth of
// the time of packing at level 6; stopping at every block with zlib would take twice as long.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace sixpoint::gt3x {

struct LastBlock {
  std::uint64_t begin_bit = 0;  // of its header; the first bit of the stream is 0
  std::uint64_t end_bit = 0;    // behind its last symbol
};

// Nothing for what is no deflate stream, or is cut short.
std::optional<LastBlock> find_last_block(std::span<const std::uint8_t> stream);

}  // namespace sixpoint::gt3x
