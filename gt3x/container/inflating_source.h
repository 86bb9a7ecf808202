// The bytes of one zip entry from the packed bytes that the archive holds, with their check.
//
//   EntryFacts facts = {EntryFacts::Packing::deflate, size, crc32, "in.gt3x:log.bin"};
//   const auto bytes = unpack_entry(std::move(packed), facts);
//   SIXPOINT_ASSIGN(const std::size_t count, bytes->read(piece));
//
// Intel's isa-l inflates: on a week at 100 Hz it takes 0.4 of the time of zlib, and unlike
// libdeflate it needs no buffer for the whole entry.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "gt3x/container/byte_source.h"

namespace sixpoint::gt3x {

struct EntryFacts {
  enum class Packing { store, deflate };
  Packing packing = Packing::store;
  std::uint64_t size = 0;   // unpacked
  std::uint32_t crc32 = 0;  // of the unpacked bytes, as in the archive's list of entries
  std::string where;        // for errors
};

// read() answers bad_data for a damaged stream, for one byte more or less than `size`, and, with
// the answer that is the end, for a wrong CRC. After an error it answers the same error.
std::unique_ptr<ByteSource> unpack_entry(std::unique_ptr<ByteSource> packed,
                                         const EntryFacts& facts);

}  // namespace sixpoint::gt3x
