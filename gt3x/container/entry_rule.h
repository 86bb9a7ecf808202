// Which entries a recording may have: the one rule for those of the archive's list, and for those
// that were found without it.
//
//   EntryHeader header;
//   header.name = "log.bin";
//   if (const auto refusal = why_refused(header, ArchiveLimits{})) {
//     return fail(ErrorCode::bad_data, refusal->what, path, refusal->hint);
//   }
//
// | entry                                                      | answer                           |
// |------------------------------------------------------------|----------------------------------|
// | a name that leaves the archive (stays_inside() is false)   | refused                          |
// | a symbolic link                                            | refused                          |
// | encrypted                                                  | refused, "encrypted"             |
// | packed otherwise than stored and deflate                   | refused, by name: deflate64 ...  |
// | more bytes than the limits allow                           | refused                          |
// | anything else                                              | taken                            |
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace sixpoint::gt3x {

// What no recording is larger than. A recording has a handful of entries; a hundred days at 100 Hz
// in 16 bits make 5 GB. Deflate reaches 1032 : 1, a log of a unit that lay still about 40 : 1, so
// beyond `ratio` an entry is no recording but an attempt to fill a disk.
struct ArchiveLimits {
  std::uint64_t entries = 200;
  std::uint64_t entry_bytes = std::uint64_t{16} << 30;
  std::uint64_t ratio = 300;  // bytes to packed bytes
  std::uint64_t ratio_matters_from_bytes = std::uint64_t{64} << 20;

  bool allow(std::uint64_t bytes, std::uint64_t packed_bytes) const {
    return bytes <= entry_bytes &&
           (bytes <= ratio_matters_from_bytes || bytes / ratio <= packed_bytes);
  }
};

inline constexpr std::uint16_t kMethodStore = 0;
inline constexpr std::uint16_t kMethodDeflate = 8;

struct EntryHeader {
  std::string name;
  std::uint64_t size = 0;
  std::uint64_t packed_size = 0;
  std::uint16_t method = kMethodStore;  // APPNOTE 4.4.5
  bool encrypted = false;
  bool symbolic_link = false;
};

struct Refusal {
  std::string what;
  std::string hint;
};
std::optional<Refusal> why_refused(const EntryHeader& header, const ArchiveLimits& limits);

// Whether a name may be carried over: at most 255 bytes without control characters that name a
// place inside the archive, also in folders of it ("notes/extra.bin"). Not absolute ("/a", "\a",
// "C:a"), no part "..", no folder ("a/"). Both slashes separate, because what unpacks it may take
// both for that.
bool stays_inside(std::string_view name);

}  // namespace sixpoint::gt3x
