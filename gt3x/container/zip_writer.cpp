#include "gt3x/container/zip_writer.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <isa-l/crc.h>

#include "base/text/utf8.h"
#include "gt3x/container/pack_line.h"
#include "gt3x/container/zip_format.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::uint16_t kNeeds = 20;  // deflate
constexpr std::uint16_t kNeedsZip64 = 45;
constexpr std::uint16_t kMadeBy = 3U << 8U | kNeedsZip64;  // Unix: the attributes below
constexpr std::uint32_t kAttributes = 0100644U << 16U;
constexpr std::uint16_t kUtf8Name = 1U << 11U;
constexpr std::uint16_t kStored = 0;
constexpr std::uint16_t kDeflated = 8;
// 1980-01-01 00:00:00, the zero of MS-DOS time.
constexpr std::uint16_t kDosDate = 0x21;
constexpr std::uint16_t kDosTime = 0;
constexpr std::uint16_t kSee64Entries = std::numeric_limits<std::uint16_t>::max();
// Deflate makes what it cannot pack a little larger.
constexpr std::uint64_t kSurelyBelow64 = zip::kSee64 - (std::uint64_t{16} << 20);

// A header's numbers, little-endian.
class Header {
 public:
  Header& u16(std::uint64_t value) { return put(value, 2); }
  Header& u32(std::uint64_t value) { return put(value, 4); }
  Header& u64(std::uint64_t value) { return put(value, 8); }
  // In 32 bits, or the sign that the number stands elsewhere.
  Header& u32_or_sign(std::uint64_t value) {
    return u32(std::min<std::uint64_t>(value, zip::kSee64));
  }
  Header& bytes(std::span<const std::uint8_t> more) {
    out_.insert(out_.end(), more.begin(), more.end());
    return *this;
  }
  const Bytes& out() const { return out_; }

 private:
  Header& put(std::uint64_t value, unsigned count) {
    for (unsigned i = 0; i < count; ++i) {
      out_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    }
    return *this;
  }
  Bytes out_;
};

std::uint16_t method_of(Packing packing) { return packing == Packing::store ? kStored : kDeflated; }

std::uint16_t flags_of(const std::string& name, bool described_behind) {
  const bool ascii = std::ranges::all_of(name, [](char c) { return (c & 0x80) == 0; });
  return static_cast<std::uint16_t>((described_behind ? zip::kDescribedBehind : 0) |
                                    (!ascii && is_utf8(name) ? kUtf8Name : 0));
}

std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t before) {
  return crc32_gzip_refl(before, bytes.data(), bytes.size());
}

// The piece behind `before`, or the first one; shorter than kPackedPieceSize only at the end of the
// source.
Status fill(ByteSource& source, const Bytes* before, Bytes& piece) {
  if (before != nullptr && before->size() < kPackedPieceSize) {
    piece.clear();
    return {};
  }
  // Memory comes as bytes do: clearing it all would cost more than packing a small entry.
  constexpr std::size_t kFirst = std::size_t{64} * 1024;
  piece.resize(before == nullptr ? kFirst : kPackedPieceSize);
  std::size_t filled = 0;
  while (filled < kPackedPieceSize) {
    if (filled == piece.size()) {
      piece.resize(2 * piece.size());
    }
    SIXPOINT_ASSIGN(const std::size_t count, source.read(std::span(piece).subspan(filled)));
    if (count == 0) {
      break;
    }
    filled += count;
  }
  piece.resize(filled);
  return {};
}

}  // namespace

Status ZipWriter::put(std::span<const std::uint8_t> bytes) {
  at_ += bytes.size();
  return sink_(bytes);
}

Status ZipWriter::begin(Entry& entry) {
  entry.offset = at_;
  Header extra;
  if (entry.zip64) {
    extra.u16(zip::kZip64Id).u16(16).u64(entry.size).u64(entry.packed_size);
  }
  Header header;
  header.u32(zip::kLocalHeader)
      .u16(entry.zip64 ? kNeedsZip64 : kNeeds)
      .u16(flags_of(entry.name, entry.described_behind))
      .u16(method_of(entry.packing))
      .u16(kDosTime)
      .u16(kDosDate)
      .u32(entry.crc32)
      .u32(entry.zip64 ? zip::kSee64 : entry.packed_size)
      .u32(entry.zip64 ? zip::kSee64 : entry.size)
      .u16(entry.name.size())
      .u16(extra.out().size())
      .bytes(as_bytes(entry.name))
      .bytes(extra.out());
  return put(header.out());
}

Status ZipWriter::add(const std::string& name, ByteSource& source, Packing packing) {
  Entry entry;
  entry.name = name;
  entry.packing = packing;
  Bytes first;
  Bytes second;
  SIXPOINT_CHECK(fill(source, nullptr, first));
  SIXPOINT_CHECK(fill(source, &first, second));
  return second.empty()
             ? add_whole(std::move(entry), first)
             : add_in_pieces(std::move(entry), source, std::move(first), std::move(second));
}

Status ZipWriter::add_whole(Entry entry, std::span<const std::uint8_t> bytes) {
  entry.size = bytes.size();
  entry.crc32 = crc32_of(bytes, 0);
  Bytes packed;
  if (entry.packing == Packing::deflate) {
    if (!packer_) {
      packer_ = std::make_unique<PiecePacker>();
    }
    packer_->pack(bytes, PiecePacker::Place::last, packed);
    if (packed.size() < bytes.size()) {
      bytes = packed;
    } else {
      entry.packing = Packing::store;
    }
  }
  entry.packed_size = bytes.size();
  SIXPOINT_CHECK(begin(entry));
  SIXPOINT_CHECK(put(bytes));
  entries_.push_back(std::move(entry));
  return {};
}

Status ZipWriter::add_packed(const std::string& name, ByteSource& packed, const EntryFacts& facts) {
  Entry entry;
  entry.name = name;
  entry.packing = facts.packing;
  entry.size = facts.size;
  entry.crc32 = facts.crc32;
  entry.packed_size = facts.packed_size;
  entry.zip64 = std::max(facts.size, facts.packed_size) >= zip::kSee64;
  SIXPOINT_CHECK(begin(entry));
  Bytes piece;
  std::uint64_t copied = 0;
  do {
    SIXPOINT_CHECK(fill(packed, nullptr, piece));
    SIXPOINT_CHECK(put(piece));
    copied += piece.size();
  } while (piece.size() == kPackedPieceSize);
  if (copied != facts.packed_size) {
    return fail(ErrorCode::bad_data, "the entry has another length than its archive says",
                facts.where, "check the disk, and run the command again");
  }
  entries_.push_back(std::move(entry));
  return {};
}

Status ZipWriter::add_in_pieces(Entry entry, ByteSource& source, Bytes first, Bytes second) {
  entry.described_behind = true;
  entry.zip64 = source.size().value_or(zip::kSee64) > kSurelyBelow64;
  SIXPOINT_CHECK(begin(entry));
  SIXPOINT_CHECK(entry.packing == Packing::deflate
                     ? put_pieces_packed(entry, source, std::move(first), std::move(second))
                     : put_pieces_stored(entry, source, std::move(first), std::move(second)));
  if (!entry.zip64 && std::max(entry.size, entry.packed_size) >= zip::kSee64) {
    return fail(ErrorCode::internal, "the entry is longer than its source said", entry.name,
                "please report it with the command line");
  }
  Header behind;
  behind.u32(zip::kDescriptor).u32(entry.crc32);
  if (entry.zip64) {
    behind.u64(entry.packed_size).u64(entry.size);
  } else {
    behind.u32(entry.packed_size).u32(entry.size);
  }
  SIXPOINT_CHECK(put(behind.out()));
  entries_.push_back(std::move(entry));
  return {};
}

Status ZipWriter::put_pieces_stored(Entry& entry, ByteSource& source, Bytes first, Bytes second) {
  while (!first.empty()) {
    entry.crc32 = crc32_of(first, entry.crc32);
    entry.size += first.size();
    SIXPOINT_CHECK(put(first));
    SIXPOINT_CHECK(fill(source, &second, first));
    first.swap(second);
  }
  entry.packed_size = entry.size;
  return {};
}

Status ZipWriter::put_pieces_packed(Entry& entry, ByteSource& source, Bytes piece, Bytes next) {
  PackLine line(jobs_, [&](std::span<const std::uint8_t> packed) {
    entry.packed_size += packed.size();
    entry.points.packed_sizes.push_back(static_cast<std::uint32_t>(packed.size()));
    return put(packed);
  });
  while (!piece.empty()) {
    entry.crc32 = crc32_of(piece, entry.crc32);
    entry.size += piece.size();
    SIXPOINT_CHECK(
        line.put(piece, next.empty() ? PiecePacker::Place::last : PiecePacker::Place::inner));
    piece.swap(next);
    SIXPOINT_CHECK(fill(source, &piece, next));
  }
  return line.finish();
}

Status ZipWriter::finish() {
  const std::uint64_t start = at_;
  for (const Entry& entry : entries_) {
    Header zip64;
    for (const std::uint64_t number : {entry.size, entry.packed_size, entry.offset}) {
      if (number >= zip::kSee64) {
        zip64.u64(number);
      }
    }
    Header extra;
    if (!zip64.out().empty()) {
      extra.u16(zip::kZip64Id).u16(zip64.out().size()).bytes(zip64.out());
    }
    extra.bytes(to_extra_field(entry.points));
    Header header;
    header.u32(zip::kCentralHeader)
        .u16(kMadeBy)
        .u16(entry.zip64 || !zip64.out().empty() ? kNeedsZip64 : kNeeds)
        .u16(flags_of(entry.name, entry.described_behind))
        .u16(method_of(entry.packing))
        .u16(kDosTime)
        .u16(kDosDate)
        .u32(entry.crc32)
        .u32_or_sign(entry.packed_size)
        .u32_or_sign(entry.size)
        .u16(entry.name.size())
        .u16(extra.out().size())
        .u16(0)  // comment
        .u16(0)  // disk
        .u16(0)  // internal attributes
        .u32(kAttributes)
        .u32_or_sign(entry.offset)
        .bytes(as_bytes(entry.name))
        .bytes(extra.out());
    SIXPOINT_CHECK(put(header.out()));
  }
  const std::uint64_t size = at_ - start;
  Header end;
  if (start >= zip::kSee64 || size >= zip::kSee64 || entries_.size() >= kSee64Entries) {
    const std::uint64_t end64 = at_;
    end.u32(zip::kEnd64).u64(44).u16(kMadeBy).u16(kNeedsZip64).u32(0).u32(0);
    end.u64(entries_.size()).u64(entries_.size()).u64(size).u64(start);
    end.u32(zip::kEnd64Locator).u32(0).u64(end64).u32(1);
  }
  const auto count = std::min<std::uint64_t>(entries_.size(), kSee64Entries);
  end.u32(zip::kEnd).u16(0).u16(0).u16(count).u16(count).u32_or_sign(size).u32_or_sign(start).u16(
      0);
  return put(end.out());
}

}  // namespace sixpoint::gt3x
