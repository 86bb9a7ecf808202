// Small pieces of a file at known places (private to this room): the headers of a zip archive.
//
//   SIXPOINT_ASSIGN(const Bytes header, bytes_at(*file, 0, 30));
//   const std::uint64_t signature = number_at(header, 0, 4);
#pragma once

#include <cstdint>
#include <span>

#include "base/env.h"

namespace sixpoint::gt3x {

// Up to `count` bytes from `offset` on; fewer at the end of the file.
inline Result<Bytes> bytes_at(const ReadableFile& file, std::uint64_t offset, std::size_t count) {
  Bytes bytes(count);
  std::size_t filled = 0;
  while (filled < count) {
    SIXPOINT_ASSIGN(const std::size_t more,
                    file.read_at(offset + filled, std::span(bytes).subspan(filled)));
    if (more == 0) {
      break;
    }
    filled += more;
  }
  bytes.resize(filled);
  return bytes;
}

// The little-endian number of `size` bytes at `at`; what lies behind the end counts as 0.
inline std::uint64_t number_at(std::span<const std::uint8_t> bytes, std::size_t at,
                               std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size && at + i < bytes.size(); ++i) {
    value |= std::uint64_t{bytes[at + i]} << (8 * i);
  }
  return value;
}

}  // namespace sixpoint::gt3x
