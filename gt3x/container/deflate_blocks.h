// Where the last block of a deflate stream begins, so that streams can be joined into one.
//
//   LastBlockFinder finder;
//   const auto last = finder.find(stream, bytes);
//   if (last) {  // no longer the last one
//     stream[last->begin_bit / 8] ^= static_cast<std::uint8_t>(1U << (last->begin_bit % 8));
//   }
//
// The first bit of a block says whether it is the last of its stream (RFC 1951, 3.2.3). libdeflate
// makes whole streams only and does not tell where its blocks begin. Two ways lead there:
//
// From the end: every bit at which a last block with codes of its own could begin (3.2.7) is tried
// with zlib, backwards. The block is found where zlib unpacks from that bit to the very end of the
// stream, and what comes out is the end of `bytes`, at least 1,024 of them: that does not happen by
// chance. Takes a twentieth of the time of packing at level 6.
//
// From the front, where that finds nothing (a short stream, a stored block, fixed codes): zlib
// unpacks the whole stream and stops at every block. Takes a quarter.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/bytes.h"

struct z_stream_s;

namespace sixpoint::gt3x {

struct LastBlock {
  std::uint64_t begin_bit = 0;  // of its header; the first bit of the stream is 0
  std::uint64_t end_bit = 0;    // behind its last symbol
};

// One object belongs to one thread. Memory: 370 kB.
class LastBlockFinder {
 public:
  LastBlockFinder();
  LastBlockFinder(const LastBlockFinder&) = delete;
  LastBlockFinder& operator=(const LastBlockFinder&) = delete;
  ~LastBlockFinder();

  // `bytes`: what the stream unpacks to. Nothing for what is no deflate stream, is cut short, or
  // has bytes behind it.
  std::optional<LastBlock> find(std::span<const std::uint8_t> stream,
                                std::span<const std::uint8_t> bytes);

 private:
  std::optional<LastBlock> from_the_end(std::span<const std::uint8_t> stream,
                                        std::span<const std::uint8_t> bytes);
  std::optional<LastBlock> from_the_front(std::span<const std::uint8_t> stream);
  bool header_at(std::span<const std::uint8_t> stream, std::uint64_t bit);
  std::optional<std::size_t> unpack_rest(std::span<const std::uint8_t> before);
  std::optional<LastBlock> block_at(std::span<const std::uint8_t> stream,
                                    std::span<const std::uint8_t> bytes, std::uint64_t bit);

  std::unique_ptr<z_stream_s> zlib_;
  Bytes unpacked_;
};

}  // namespace sixpoint::gt3x
