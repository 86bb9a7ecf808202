#include "mocks/usb/fat_image.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "base/error.h"
#include "device/wire/payload.h"

namespace sixpoint::mocks {

namespace {

using device::PayloadWriter;

constexpr std::uint32_t kBlock = kBlockBytes;  // as wide as the numbers of a FAT
constexpr std::uint32_t kBlocks = (96U << 20U) / kBlock;
constexpr std::uint32_t kBlocksPerCluster = 4;
constexpr std::uint32_t kClusterBytes = kBlocksPerCluster * kBlock;
constexpr std::uint32_t kReservedBlocks = 1;
constexpr std::uint32_t kRootEntries = 512;
constexpr std::uint32_t kEntryBytes = 32;
constexpr std::uint32_t kRootBlocks = kRootEntries * kEntryBytes / kBlock;
// Two bytes per cluster, counted before the FATs themselves are taken off the volume.
constexpr std::uint32_t kFatBlocks = ((kBlocks / kBlocksPerCluster + 2) * 2 + kBlock - 1) / kBlock;
constexpr std::uint32_t kDataStart = kReservedBlocks + 2 * kFatBlocks + kRootBlocks;
constexpr std::uint32_t kClusters = (kBlocks - kDataStart) / kBlocksPerCluster;
static_assert(kClusters >= 4085 && kClusters < 65525, "the number of clusters makes it FAT16");

constexpr const char* kLabel = "SIXPOINT   ";
constexpr std::uint32_t kVolumeId = 0x36B0;  // shown by file managers
constexpr std::uint8_t kFixedDisk = 0xF8;
constexpr std::uint16_t kEndOfFile = 0xFFFF;
constexpr std::uint8_t kReadOnly = 0x01;
constexpr std::uint8_t kVolumeLabel = 0x08;
constexpr std::uint8_t kFolder = 0x10;
// Windows NT's flags: name and extension are shown in lower case.
constexpr std::uint8_t kLowerCase = 0x18;

std::string padded(std::string text, std::size_t width) {
  text.resize(width, ' ');
  return text;
}

Bytes boot_block() {
  Bytes boot = PayloadWriter()
                   .put(Bytes{0xEB, 0x3C, 0x90})  // jump over the parameters to the loop below
                   .put("SIXPOINT", 8)
                   .put(std::uint16_t{kBlockBytes})
                   .put(std::uint8_t{kBlocksPerCluster})
                   .put(std::uint16_t{kReservedBlocks})
                   .put(std::uint8_t{2})  // FATs
                   .put(std::uint16_t{kRootEntries})
                   .put(std::uint16_t{0})  // the number of blocks does not fit here
                   .put(kFixedDisk)
                   .put(std::uint16_t{kFatBlocks})
                   .put(std::uint16_t{63})  // sectors per track and heads, for an old BIOS
                   .put(std::uint16_t{255})
                   .put(std::uint32_t{0})
                   .put(kBlocks)
                   .put(Bytes{0x80, 0, 0x29})
                   .put(kVolumeId)
                   .put(kLabel, 11)
                   .put("FAT16   ", 8)
                   .put(Bytes{0xEB, 0xFE})  // an endless loop: there is nothing to boot
                   .take();
  boot.resize(kBlockBytes, 0);
  boot[510] = 0x55;
  boot[511] = 0xAA;
  return boot;
}

// A name of 11 characters, and the flags of its case.
struct ShortName {
  std::string padded;
  std::uint8_t case_flags = 0;
};

ShortName short_name(const std::string& name) {
  const std::size_t dot = std::min(name.find('.'), name.size());
  ShortName result{padded(name.substr(0, dot), 8) +
                   padded(name.substr(std::min(dot + 1, name.size())), 3)};
  for (char& letter : result.padded) {
    const auto upper = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
    result.case_flags = letter == upper ? result.case_flags : kLowerCase;
    letter = upper;
  }
  return result;
}

void append_entry(Bytes& out, const ShortName& name, std::uint8_t attributes, UtcTime modified,
                  std::uint16_t cluster, std::size_t size) {
  const auto day = std::chrono::floor<std::chrono::days>(modified);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::seconds>(modified) - day);
  const int year = std::clamp(static_cast<int>(date.year()), 1980, 2107);
  const auto fat_date = static_cast<std::uint16_t>((static_cast<unsigned>(year - 1980) << 9U) |
                                                   (static_cast<unsigned>(date.month()) << 5U) |
                                                   static_cast<unsigned>(date.day()));
  const auto fat_time =
      static_cast<std::uint16_t>((static_cast<unsigned>(clock.hours().count()) << 11U) |
                                 (static_cast<unsigned>(clock.minutes().count()) << 5U) |
                                 static_cast<unsigned>(clock.seconds().count() / 2));
  const Bytes entry = PayloadWriter()
                          .put(name.padded, 11)
                          .put(attributes)
                          .put(name.case_flags)
                          .put(std::uint8_t{0})
                          .put(fat_time)  // created, used, modified
                          .put(fat_date)
                          .put(fat_date)
                          .put(std::uint16_t{0})
                          .put(fat_time)
                          .put(fat_date)
                          .put(cluster)
                          .put(static_cast<std::uint32_t>(size))
                          .take();
  out.insert(out.end(), entry.begin(), entry.end());
}

tl::unexpected<Error> does_not_fit() {
  return fail(ErrorCode::configuration, "the files do not fit into the volume", "SIXPOINT",
              "make the recordings shorter");
}

}  // namespace

// Files lie one behind the other, so that a file is one extent.
class FatImage::Builder {
 public:
  // The first cluster; 0 for an empty file.
  Result<std::uint16_t> place(std::shared_ptr<const Bytes> content) {
    const std::size_t count = (content->size() + kClusterBytes - 1) / kClusterBytes;
    if (count == 0) {
      return std::uint16_t{0};
    }
    if (count > kClusters + 2 - next_cluster()) {
      return does_not_fit();
    }
    const std::uint16_t first = next_cluster();
    extents_.push_back({kDataStart + (first - 2U) * kBlocksPerCluster,
                        static_cast<std::uint32_t>(count) * kBlocksPerCluster, std::move(content)});
    for (std::size_t i = 1; i < count; ++i) {
      table_.push_back(static_cast<std::uint16_t>(first + i));
    }
    table_.push_back(kEndOfFile);
    return first;
  }
  std::uint16_t next_cluster() const { return static_cast<std::uint16_t>(table_.size()); }

  Result<FatImage> finish(const Bytes& root) && {
    if (root.size() > std::size_t{kRootEntries} * kEntryBytes) {
      return does_not_fit();
    }
    PayloadWriter fat;
    for (const std::uint16_t next : table_) {
      fat.put(next);
    }
    Bytes table = fat.take();
    table.resize(kFatBlocks * kBlockBytes, 0);
    FatImage image;
    image.head_ = PayloadWriter().put(boot_block()).put(table).put(table).put(root).take();
    image.head_.resize(kDataStart * kBlockBytes, 0);
    image.extents_ = std::move(extents_);
    return image;
  }

 private:
  std::vector<std::uint16_t> table_ = {0xFF00U | kFixedDisk, kEndOfFile};  // from cluster 2
  std::vector<Extent> extents_;
};

Result<FatImage> FatImage::make(const std::vector<FatFile>& files) {
  std::map<std::string, std::vector<const FatFile*>> folders;
  folders[""];  // the root, before all others
  for (const FatFile& file : files) {
    const std::size_t slash = file.path.find('/');
    folders[slash == std::string::npos ? "" : file.path.substr(0, slash)].push_back(&file);
  }
  Builder builder;
  Bytes root;
  append_entry(root, {kLabel}, kVolumeLabel, {}, 0, 0);
  for (const auto& [folder, inside] : folders) {
    Bytes entries;
    for (const FatFile* file : inside) {
      SIXPOINT_ASSIGN(const auto first, builder.place(file->content));
      const std::string name = file->path.substr(folder.empty() ? 0 : folder.size() + 1);
      append_entry(entries, short_name(name), kReadOnly, file->modified, first,
                   file->content->size());
    }
    if (folder.empty()) {
      root.insert(root.end(), entries.begin(), entries.end());
      continue;
    }
    const UtcTime modified = inside.front()->modified;
    Bytes list;
    append_entry(list, {padded(".", 11)}, kFolder, modified, builder.next_cluster(), 0);
    append_entry(list, {padded("..", 11)}, kFolder, modified, 0, 0);
    list.insert(list.end(), entries.begin(), entries.end());
    SIXPOINT_ASSIGN(const auto own, builder.place(std::make_shared<const Bytes>(std::move(list))));
    append_entry(root, short_name(folder), kFolder, modified, own, 0);
  }
  return std::move(builder).finish(root);
}

std::uint32_t FatImage::blocks() const { return kBlocks; }

void FatImage::read(std::uint32_t block, std::span<std::uint8_t, kBlockBytes> out) const {
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  const auto copy = [&out](const Bytes& from, std::size_t at) {
    if (at < from.size()) {
      const auto begin = from.begin() + static_cast<std::ptrdiff_t>(at);
      std::copy_n(begin, std::min(kBlockBytes, from.size() - at), out.begin());
    }
  };
  if (block < kDataStart) {
    copy(head_, std::size_t{block} * kBlockBytes);
    return;
  }
  const auto after = std::upper_bound(
      extents_.begin(), extents_.end(), block,
      [](std::uint32_t wanted, const Extent& extent) { return wanted < extent.first_block; });
  if (after != extents_.begin()) {
    const Extent& extent = *std::prev(after);
    if (block - extent.first_block < extent.blocks) {
      copy(*extent.content, std::size_t{block - extent.first_block} * kBlockBytes);
    }
  }
}

}  // namespace sixpoint::mocks
