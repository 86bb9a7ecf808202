// The entries of a zip archive by the headers that stand before each of them: how an archive is
// read whose list of entries is missing, because the file was cut short or damaged.
//
//   SIXPOINT_ASSIGN(const auto found, find_local_entries(*file, ArchiveLimits{}));
//   for (const LocalEntry& entry : found) {
//     auto packed = packed_bytes_of(file, entry);
//   }
//
// Where an entry ends:
//
// | its header                                      | the entry ends                              |
// |-------------------------------------------------|---------------------------------------------|
// | says the packed size, and there a header or the | there                                       |
// | end of the file stands                          |                                             |
// | says a size that reaches behind the file        | with the file; it is cut short              |
// | says that the sizes stand behind it             | before a descriptor that fits, which says   |
// |                                                 | its size and CRC                            |
// | anything else                                   | before the next header; its size and CRC    |
// |                                                 | are not known                               |
//
// The file is read once from its beginning to its end. At most limits.entries + 1 are found.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/env.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/container/entry_rule.h"

namespace sixpoint::gt3x {

struct LocalEntry {
  EntryHeader header;       // sizes as said, or what is there where `size_known` is false
  bool size_known = false;  // unpacked
  bool crc_known = false;
  std::uint32_t crc32 = 0;
  std::uint64_t offset = 0;        // of its packed bytes
  std::uint64_t packed_bytes = 0;  // that are there
};

// Errors of the disk only.
Result<std::vector<LocalEntry>> find_local_entries(const ReadableFile& file,
                                                   const ArchiveLimits& limits);

// The packed bytes that are there. `file` stays open as long as the source lives.
std::unique_ptr<ByteSource> packed_bytes_of(std::shared_ptr<const ReadableFile> file,
                                            const LocalEntry& entry);

}  // namespace sixpoint::gt3x
