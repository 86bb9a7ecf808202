// Writes a zip archive as a stream: each byte once, from the first to the last.
//
//   Bytes archive;
//   ZipWriter zip([&](std::span<const std::uint8_t> bytes) {
//     archive.insert(archive.end(), bytes.begin(), bytes.end());
//     return Status{};
//   });
//   MemorySource text(Bytes{'a', 'b'});
//   SIXPOINT_CHECK(zip.add("info.txt", text, Packing::deflate));
//   SIXPOINT_CHECK(zip.finish());
//
// Nothing that was written is changed later, so that the bytes can be hashed as they pass. An entry
// of more than one piece (piece_packer.h) therefore has its sizes and its CRC in a data descriptor
// behind it (APPNOTE 4.3.9) and in the central directory; readers that go by the directory, as
// unzip, Python's zipfile and R's unz do, read deflated and stored entries of this kind alike.
// zip64 where sizes ask for it, or are not known beforehand. Every entry has the same time stamp,
// 1980-01-01, so that the same entries give the same bytes, whatever the number of threads.
//
// One object belongs to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gt3x/container/byte_source.h"
#include "gt3x/container/inflating_source.h"
#include "gt3x/container/piece_packer.h"
#include "gt3x/container/sync_points.h"

namespace sixpoint::gt3x {

class ZipWriter {
 public:
  using Sink = std::function<Status(std::span<const std::uint8_t>)>;

  // Entries are packed on `jobs` threads beside the calling one; 1: on the calling one.
  explicit ZipWriter(Sink sink, unsigned jobs = 1) : sink_(std::move(sink)), jobs_(jobs) {}

  // Reads `source` to its end. An entry that deflate would not make smaller is stored. Errors are
  // those of the source and of the sink; the archive is then of no use.
  Status add(const std::string& name, ByteSource& source, Packing packing);
  // The packed bytes of an entry of another archive, as they are.
  Status add_packed(const std::string& name, ByteSource& packed, const EntryFacts& facts);
  // The central directory. Nothing may be added behind it.
  Status finish();

 private:
  struct Entry {
    std::string name;
    Packing packing = Packing::store;
    bool described_behind = false;  // its sizes and its CRC were not known before its bytes
    bool zip64 = false;             // in its local header
    std::uint32_t crc32 = 0;
    std::uint64_t size = 0;
    std::uint64_t packed_size = 0;
    std::uint64_t offset = 0;
    SyncPoints points;
  };
  Status put(std::span<const std::uint8_t> bytes);
  Status begin(Entry& entry);
  Status add_whole(Entry entry, std::span<const std::uint8_t> bytes);
  Status add_in_pieces(Entry entry, ByteSource& source, Bytes first, Bytes second);
  Status put_pieces_packed(Entry& entry, ByteSource& source, Bytes first, Bytes second);
  Status put_pieces_stored(Entry& entry, ByteSource& source, Bytes first, Bytes second);

  Sink sink_;
  unsigned jobs_;
  std::uint64_t at_ = 0;
  std::vector<Entry> entries_;
  std::unique_ptr<PiecePacker> packer_;  // of small entries, one after the other
};

}  // namespace sixpoint::gt3x
