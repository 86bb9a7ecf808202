// Zip archives made byte by byte for tests, also such as no program writes. Shares no code with
// gt3x/container: CRC and deflate are zlib's.
#pragma once

#include <string>
#include <vector>

#include <zlib.h>

#include "base/bytes.h"

namespace sixpoint::gt3x::tests {

struct MadeEntry {
  std::string name;
  Bytes bytes;
  bool deflated = false;
  bool described_behind = false;  // sizes and CRC in a descriptor
  std::uint16_t flags = 0;
  int method = -1;  // what the headers say, where it is not what was done
  std::uint32_t attributes = 0100644U << 16U;
  bool listed_only = false;  // the list says that it is the entry before
};

inline Bytes zlib_deflated(const Bytes& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  Bytes out(deflateBound(&stream, static_cast<uLong>(bytes.size())));
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

class MadeArchive {
 public:
  explicit MadeArchive(const std::vector<MadeEntry>& entries) {
    for (const MadeEntry& entry : entries) {
      add(entry);
    }
    list_offset = bytes.size();
    bytes.insert(bytes.end(), list_.begin(), list_.end());
    put(bytes, 0x06054b50, 4);
    put(bytes, 0, 4);
    put(bytes, entries.size(), 2);
    put(bytes, entries.size(), 2);
    put(bytes, list_.size(), 4);
    put(bytes, list_offset, 4);
    put(bytes, 0, 2);
  }

  Bytes bytes;
  std::size_t list_offset = 0;
  std::vector<std::size_t> data_offsets;  // of each entry's packed bytes

 private:
  static void put(Bytes& out, std::uint64_t value, unsigned size) {
    for (unsigned i = 0; i < size; ++i) {
      out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    }
  }

  static void put_facts(Bytes& out, std::uint64_t crc, std::uint64_t packed, std::uint64_t size) {
    put(out, crc, 4);
    put(out, packed, 4);
    put(out, size, 4);
  }

  void add(const MadeEntry& entry) {
    const Bytes packed = entry.deflated ? zlib_deflated(entry.bytes) : entry.bytes;
    const auto crc = crc32(0, entry.bytes.data(), static_cast<uInt>(entry.bytes.size()));
    const auto flags = entry.flags | (entry.described_behind ? 8U : 0U);
    const auto method =
        static_cast<std::uint64_t>(entry.method >= 0 ? entry.method : (entry.deflated ? 8 : 0));
    const std::size_t before = bytes.size();
    const std::size_t offset = entry.listed_only ? last_offset_ : before;
    put(bytes, 0x04034b50, 4);
    put(bytes, 20, 2);
    put(bytes, flags, 2);
    put(bytes, method, 2);
    put(bytes, 0x00210000, 4);
    if (entry.described_behind) {
      put_facts(bytes, 0, 0, 0);
    } else {
      put_facts(bytes, crc, packed.size(), entry.bytes.size());
    }
    put(bytes, entry.name.size(), 2);
    put(bytes, 0, 2);
    bytes.insert(bytes.end(), entry.name.begin(), entry.name.end());
    data_offsets.push_back(bytes.size());
    bytes.insert(bytes.end(), packed.begin(), packed.end());
    if (entry.described_behind) {
      put(bytes, 0x08074b50, 4);
      put_facts(bytes, crc, packed.size(), entry.bytes.size());
    }
    if (entry.listed_only) {
      bytes.resize(before);
    }
    last_offset_ = offset;
    put(list_, 0x02014b50, 4);
    put(list_, 0x0314, 2);
    put(list_, 20, 2);
    put(list_, flags, 2);
    put(list_, method, 2);
    put(list_, 0x00210000, 4);
    put_facts(list_, crc, packed.size(), entry.bytes.size());
    put(list_, entry.name.size(), 2);
    put(list_, 0, 4);  // extra field, comment
    put(list_, 0, 4);  // disk, internal attributes
    put(list_, entry.attributes, 4);
    put(list_, offset, 4);
    list_.insert(list_.end(), entry.name.begin(), entry.name.end());
  }

  Bytes list_;
  std::size_t last_offset_ = 0;
};

}  // namespace sixpoint::gt3x::tests
