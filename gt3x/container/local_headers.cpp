#include "gt3x/container/local_headers.h"

#include <algorithm>
#include <optional>

#include "gt3x/container/file_bytes.h"
#include "gt3x/container/zip_format.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kLocalHeaderSize = 30;
constexpr std::size_t kCentralHeaderSize = 46;
constexpr std::size_t kDescriptorSize = 24;  // the longer one, of zip64
constexpr std::uint16_t kEncrypted = 1U << 0U;
constexpr std::uint64_t kNewestVersion = 63;
constexpr std::size_t kPiece = std::size_t{256} * 1024;

// Four bytes alone stand in a log by chance, one time in some gigabytes.
bool plausible(std::uint64_t version, std::uint64_t method, std::uint64_t name_size) {
  return (version & 0xFFU) <= kNewestVersion && method <= 99 && name_size >= 1 && name_size <= 255;
}

class Finder {
 public:
  Finder(const ReadableFile& file, const ArchiveLimits& limits) : file_(file), limits_(limits) {}

  Result<std::vector<LocalEntry>> run() {
    std::uint64_t at = 0;
    while (found_.size() <= limits_.entries) {
      SIXPOINT_ASSIGN(const auto header, next_header(at, nullptr));
      if (!header || header->kind != Kind::local) {
        break;
      }
      SIXPOINT_ASSIGN(at, take(header->at));
    }
    return std::move(found_);
  }

 private:
  enum class Kind { local, central, descriptor };
  struct Place {
    Kind kind = Kind::local;
    std::uint64_t at = 0;
    // Of a descriptor:
    std::uint32_t crc32 = 0;
    std::uint64_t size = 0;
    std::uint64_t end = 0;
  };

  // Takes the entry whose header stands at `at`; returns where to look for the next one.
  Result<std::uint64_t> take(std::uint64_t at) {
    SIXPOINT_ASSIGN(const Bytes fixed, bytes_at(file_, at, kLocalHeaderSize));
    const auto name_size = static_cast<std::size_t>(number_at(fixed, 26, 2));
    const auto extra_size = static_cast<std::size_t>(number_at(fixed, 28, 2));
    SIXPOINT_ASSIGN(const Bytes names,
                    bytes_at(file_, at + kLocalHeaderSize, name_size + extra_size));
    LocalEntry entry;
    const auto flags = number_at(fixed, 6, 2);
    entry.header.name.assign(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(
                                                                std::min(name_size, names.size())));
    entry.header.method = static_cast<std::uint16_t>(number_at(fixed, 8, 2));
    entry.header.encrypted = (flags & kEncrypted) != 0;
    entry.crc32 = static_cast<std::uint32_t>(number_at(fixed, 14, 4));
    entry.header.packed_size = number_at(fixed, 18, 4);
    entry.header.size = number_at(fixed, 22, 4);
    if (names.size() == name_size + extra_size) {
      take_zip64(std::span(names).subspan(name_size), entry.header);
    }
    entry.offset = at + kLocalHeaderSize + name_size + extra_size;
    const bool described_behind = (flags & zip::kDescribedBehind) != 0;
    if (!described_behind) {
      SIXPOINT_ASSIGN(const bool ends_there, ends_at(entry.offset, entry.header.packed_size));
      if (ends_there) {
        entry.size_known = true;
        entry.crc_known = true;
        return keep(std::move(entry), file_.size());
      }
    }
    SIXPOINT_ASSIGN(const auto next,
                    next_header(entry.offset, described_behind ? &entry.offset : nullptr));
    const std::uint64_t end = next ? next->at : file_.size();
    entry.header.packed_size = end > entry.offset ? end - entry.offset : 0;
    if (next && next->kind == Kind::descriptor) {
      entry.size_known = true;
      entry.crc_known = true;
      entry.crc32 = next->crc32;
      entry.header.size = next->size;
      return keep(std::move(entry), end);
    }
    entry.header.size = entry.header.method == kMethodStore ? entry.header.packed_size : 0;
    return keep(std::move(entry), end);
  }

  std::uint64_t keep(LocalEntry entry, std::uint64_t end) {
    const std::uint64_t room = end > entry.offset ? end - entry.offset : 0;
    entry.packed_bytes = std::min(entry.header.packed_size, room);
    const std::uint64_t next = entry.offset + entry.packed_bytes;
    found_.push_back(std::move(entry));
    return next;
  }

  static void take_zip64(std::span<const std::uint8_t> extra, EntryHeader& header) {
    for (std::size_t at = 0; at + 4 <= extra.size();) {
      const auto size = static_cast<std::size_t>(number_at(extra, at + 2, 2));
      if (number_at(extra, at, 2) == zip::kZip64Id && size >= 16 && header.size == zip::kSee64 &&
          header.packed_size == zip::kSee64) {
        header.size = number_at(extra, at + 4, 8);
        header.packed_size = number_at(extra, at + 12, 8);
      }
      at += 4 + size;
    }
  }

  // Whether packed bytes of this number can be right: behind them stands the end of the file,
  // or something that belongs to an archive, or they reach behind the file.
  Result<bool> ends_at(std::uint64_t offset, std::uint64_t packed_size) {
    if (packed_size >= file_.size() || offset >= file_.size() - packed_size) {
      // A cut file, or a wrong size: then a header would follow.
      SIXPOINT_ASSIGN(const auto next, next_header(offset, nullptr));
      return !next.has_value();
    }
    SIXPOINT_ASSIGN(const Bytes behind, bytes_at(file_, offset + packed_size, 4));
    const auto signature = number_at(behind, 0, 4);
    return behind.size() < 4 || signature == zip::kLocalHeader || signature == zip::kCentralHeader;
  }

  // The first header at `from` or behind it. With `described`, where packed bytes begin, also the
  // first descriptor that says that they end before it.
  Result<std::optional<Place>> next_header(std::uint64_t from, const std::uint64_t* described) {
    constexpr std::size_t kOverlap = kCentralHeaderSize + 255;
    for (std::uint64_t begin = from; begin < file_.size(); begin += kPiece) {
      SIXPOINT_ASSIGN(const Bytes piece, bytes_at(file_, begin, kPiece + kOverlap));
      const auto end = piece.begin() + static_cast<std::ptrdiff_t>(std::min(kPiece, piece.size()));
      for (auto at = std::find(piece.begin(), end, 'P'); at != end;
           at = std::find(at + 1, end, 'P')) {
        const auto place = static_cast<std::size_t>(at - piece.begin());
        const auto found = header_at(std::span(piece).subspan(place), begin + place, described);
        if (found) {
          return found;
        }
      }
    }
    return std::nullopt;
  }

  static std::optional<Place> header_at(std::span<const std::uint8_t> bytes, std::uint64_t at,
                                        const std::uint64_t* described) {
    Place place;
    place.at = at;
    switch (number_at(bytes, 0, 4)) {
      case zip::kLocalHeader: {
        const std::uint64_t name_size = number_at(bytes, 26, 2);
        const bool whole = bytes.size() >= kLocalHeaderSize + name_size;
        const bool takes =
            whole && plausible(number_at(bytes, 4, 2), number_at(bytes, 8, 2), name_size);
        return takes ? std::optional(place) : std::nullopt;
      }
      case zip::kCentralHeader:
        place.kind = Kind::central;
        return bytes.size() >= kCentralHeaderSize &&
                       plausible(number_at(bytes, 6, 2), number_at(bytes, 10, 2),
                                 number_at(bytes, 28, 2))
                   ? std::optional(place)
                   : std::nullopt;
      case zip::kDescriptor:
        return described == nullptr ? std::nullopt : descriptor_at(bytes, at, *described);
      default:
        return std::nullopt;
    }
  }

  static std::optional<Place> descriptor_at(std::span<const std::uint8_t> bytes, std::uint64_t at,
                                            std::uint64_t begin) {
    Place place;
    place.kind = Kind::descriptor;
    place.at = at;
    place.crc32 = static_cast<std::uint32_t>(number_at(bytes, 4, 4));
    const std::uint64_t packed_size = at - begin;
    if (bytes.size() >= kDescriptorSize && number_at(bytes, 8, 8) == packed_size) {
      place.size = number_at(bytes, 16, 8);
      return place;
    }
    if (bytes.size() >= kDescriptorSize - 8 && number_at(bytes, 8, 4) == packed_size) {
      place.size = number_at(bytes, 12, 4);
      return place;
    }
    return std::nullopt;
  }

  const ReadableFile& file_;
  const ArchiveLimits& limits_;
  std::vector<LocalEntry> found_;
};

class FileRange final : public ByteSource {
 public:
  FileRange(std::shared_ptr<const ReadableFile> file, std::uint64_t offset, std::uint64_t size)
      : file_(std::move(file)), offset_(offset), left_(size) {}

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), left_));
    if (wanted == 0) {
      return std::size_t{0};
    }
    SIXPOINT_ASSIGN(const std::size_t count, file_->read_at(offset_, out.first(wanted)));
    offset_ += count;
    left_ -= count;
    return count;
  }

 private:
  std::shared_ptr<const ReadableFile> file_;
  std::uint64_t offset_;
  std::uint64_t left_;
};

}  // namespace

Result<std::vector<LocalEntry>> find_local_entries(const ReadableFile& file,
                                                   const ArchiveLimits& limits) {
  return Finder(file, limits).run();
}

std::unique_ptr<ByteSource> packed_bytes_of(std::shared_ptr<const ReadableFile> file,
                                            const LocalEntry& entry) {
  return std::make_unique<FileRange>(std::move(file), entry.offset, entry.packed_bytes);
}

}  // namespace sixpoint::gt3x
