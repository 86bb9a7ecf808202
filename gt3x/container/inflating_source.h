// The bytes of one zip entry from the packed bytes that the archive holds, with their check.
//
//   EntryFacts facts;
//   facts.packing = Packing::deflate;
//   facts.size = size;
//   facts.crc32 = crc32;
//   const auto bytes = unpack_entry(std::move(packed), facts);
//   SIXPOINT_ASSIGN(const std::size_t count, bytes->read(piece));
//
// Intel's isa-l inflates: on a week at 100 Hz it takes 0.4 of the time of zlib, and unlike
// libdeflate it needs no buffer for the whole entry. An entry with an index (sync_points.h) is
// unpacked piece by piece, on several threads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "gt3x/container/byte_source.h"
#include "gt3x/container/delivery.h"
#include "gt3x/container/entry_rule.h"
#include "gt3x/container/sync_points.h"

namespace sixpoint::gt3x {

enum class Packing { store, deflate };

struct EntryFacts {
  Packing packing = Packing::store;
  std::uint64_t size = 0;  // unpacked
  std::uint64_t packed_size = 0;
  std::uint32_t crc32 = 0;  // of the unpacked bytes, as in the archive's list of entries
  // False where neither the list nor the entry's own header says it (local_headers.h).
  bool size_known = true;
  bool crc_known = true;
  SyncPoints points;  // empty: unpacked from its beginning
  std::string where;  // for errors
};

// read() answers bad_data for a damaged stream, for one byte more or less than `size`, and, with
// the answer that is the end, for a wrong CRC. After an error it answers the same error.
std::unique_ptr<ByteSource> unpack_entry(std::unique_ptr<ByteSource> packed,
                                         const EntryFacts& facts);

// What was wrong with an entry that was read all the same.
struct EntryDamage {
  Damage kind = Damage::none;
  std::uint64_t bytes = 0;  // that were delivered
  std::string why;
};

// The same for who takes what is left (delivery.h): what unpack_entry() refuses ends the bytes here
// and is told to `note`, on the thread that reads, once. Errors are those of the disk, and bad_data
// for more bytes than `limits` allow.
std::unique_ptr<ByteSource> salvage_entry(std::unique_ptr<ByteSource> packed,
                                          const EntryFacts& facts, const ArchiveLimits& limits,
                                          std::function<void(const EntryDamage&)> note);

}  // namespace sixpoint::gt3x
