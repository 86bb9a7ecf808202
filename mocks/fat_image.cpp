#include "mocks/fat_image.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <optional>
#include <string_view>

#include "base/error.h"

namespace sixpoint::mocks {

namespace {

constexpr std::uint32_t kReservedBlocks = 1;
constexpr std::uint32_t kRootEntries = 512;
constexpr std::size_t kEntryBytes = 32;
constexpr std::uint32_t kRootBlocks = kRootEntries * kEntryBytes / kBlockBytes;
// The number of clusters decides the kind (specification, "FAT Type Determination").
constexpr std::uint32_t kFat12Clusters = 4085;
constexpr std::uint32_t kFat16Clusters = 65525;
constexpr std::uint8_t kFixedDisk = 0xF8;

constexpr std::uint8_t kAttributeReadOnly = 0x01;
constexpr std::uint8_t kAttributeLabel = 0x08;
constexpr std::uint8_t kAttributeFolder = 0x10;
// Windows NT's flags: the part is shown in lower case.
constexpr std::uint8_t kLowerName = 0x08;
constexpr std::uint8_t kLowerExtension = 0x10;

template <class Integer>
void put(Bytes& bytes, std::size_t at, Integer value) {
  auto rest = static_cast<std::uint64_t>(value);
  for (std::size_t i = 0; i < sizeof(Integer); ++i) {
    bytes[at + i] = static_cast<std::uint8_t>(rest & 0xFFU);
    rest >>= 8U;
  }
}

void put_text(Bytes& bytes, std::size_t at, std::string_view text, std::size_t width) {
  for (std::size_t i = 0; i < width; ++i) {
    bytes[at + i] = static_cast<std::uint8_t>(i < text.size() ? text[i] : ' ');
  }
}

struct ShortName {
  std::string padded;  // 11 characters
  std::uint8_t case_flags = 0;
};

std::optional<ShortName> short_name(std::string_view name) {
  const std::size_t dot = std::min(name.find('.'), name.size());
  const std::string_view stem = name.substr(0, dot);
  const std::string_view extension = name.substr(std::min(dot + 1, name.size()));
  if (stem.empty() || stem.size() > 8 || extension.size() > 3 ||
      (dot < name.size() && extension.empty())) {
    return std::nullopt;
  }
  ShortName result;
  const auto add = [&result](std::string_view part, std::size_t width, std::uint8_t flag) {
    bool lower = false;
    bool upper = false;
    for (const char letter : part) {
      const bool is_letter = std::isalpha(static_cast<unsigned char>(letter)) != 0;
      const bool allowed = is_letter || std::isdigit(static_cast<unsigned char>(letter)) != 0 ||
                           letter == '_' || letter == '-';
      if (!allowed) {
        return false;
      }
      lower = lower || (is_letter && letter >= 'a');
      upper = upper || (is_letter && letter < 'a');
      result.padded += static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
    }
    result.padded.append(width - part.size(), ' ');
    if (lower) {
      result.case_flags |= flag;
    }
    return !(lower && upper);
  };
  if (!add(stem, 8, kLowerName) || !add(extension, 3, kLowerExtension)) {
    return std::nullopt;
  }
  return result;
}

struct Entry {
  std::string name;  // 11 characters
  std::uint8_t case_flags = 0;
  std::uint8_t attributes = 0;
  UtcTime modified{};
  std::uint32_t cluster = 0;
  std::uint32_t size = 0;
};

void put_entry(Bytes& bytes, std::size_t at, const Entry& entry) {
  const auto day = std::chrono::floor<std::chrono::days>(entry.modified);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::seconds>(entry.modified) - day);
  const int year = std::clamp(static_cast<int>(date.year()), 1980, 2107);
  const auto fat_date = static_cast<std::uint16_t>((static_cast<unsigned>(year - 1980) << 9U) |
                                                   (static_cast<unsigned>(date.month()) << 5U) |
                                                   static_cast<unsigned>(date.day()));
  const auto fat_time =
      static_cast<std::uint16_t>((static_cast<unsigned>(clock.hours().count()) << 11U) |
                                 (static_cast<unsigned>(clock.minutes().count()) << 5U) |
                                 static_cast<unsigned>(clock.seconds().count() / 2));
  put_text(bytes, at, entry.name, 11);
  bytes[at + 11] = entry.attributes;
  bytes[at + 12] = entry.case_flags;
  put(bytes, at + 14, fat_time);
  put(bytes, at + 16, fat_date);
  put(bytes, at + 18, fat_date);
  put(bytes, at + 22, fat_time);
  put(bytes, at + 24, fat_date);
  put(bytes, at + 26, static_cast<std::uint16_t>(entry.cluster));
  put(bytes, at + 28, entry.size);
}

struct Layout {
  std::uint32_t blocks = 0;
  std::uint32_t blocks_per_cluster = 0;
  std::uint32_t fat_blocks = 0;
  std::uint32_t clusters = 0;
  int fat_bits = 16;

  std::uint32_t data_start() const { return kReservedBlocks + 2 * fat_blocks + kRootBlocks; }
};

// The smallest clusters that FAT16 can count.
std::optional<Layout> lay_out(std::uint64_t volume_bytes) {
  if (volume_bytes / kBlockBytes > 0xFFFFFFFFU) {
    return std::nullopt;
  }
  Layout layout;
  layout.blocks = static_cast<std::uint32_t>(volume_bytes / kBlockBytes);
  for (layout.blocks_per_cluster = 1; layout.blocks_per_cluster <= 64;
       layout.blocks_per_cluster *= 2) {
    for (const int bits : {12, 16}) {
      layout.fat_bits = bits;
      // A FAT for all blocks is at most a few entries longer than needed.
      const std::uint64_t entries = layout.blocks / layout.blocks_per_cluster + 2ULL;
      layout.fat_blocks = static_cast<std::uint32_t>(
          (entries * static_cast<unsigned>(bits) + 8 * kBlockBytes - 1) / (8 * kBlockBytes));
      if (layout.blocks <= layout.data_start()) {
        continue;
      }
      layout.clusters = (layout.blocks - layout.data_start()) / layout.blocks_per_cluster;
      const bool fits = bits == 12
                            ? layout.clusters > 0 && layout.clusters < kFat12Clusters
                            : layout.clusters >= kFat12Clusters && layout.clusters < kFat16Clusters;
      if (fits) {
        return layout;
      }
    }
  }
  return std::nullopt;
}

Bytes boot_block(const Layout& layout, const FatImageOptions& options) {
  Bytes boot(kBlockBytes, 0);
  boot[0] = 0xEB;  // jump over the parameters to the loop below
  boot[1] = 0x3C;
  boot[2] = 0x90;
  put_text(boot, 3, "SIXPOINT", 8);
  put(boot, 11, static_cast<std::uint16_t>(kBlockBytes));
  boot[13] = static_cast<std::uint8_t>(layout.blocks_per_cluster);
  put(boot, 14, static_cast<std::uint16_t>(kReservedBlocks));
  boot[16] = 2;
  put(boot, 17, static_cast<std::uint16_t>(kRootEntries));
  if (layout.blocks < 65536) {
    put(boot, 19, static_cast<std::uint16_t>(layout.blocks));
  } else {
    put(boot, 32, layout.blocks);
  }
  boot[21] = kFixedDisk;
  put(boot, 22, static_cast<std::uint16_t>(layout.fat_blocks));
  put(boot, 24, std::uint16_t{63});  // sectors per track and heads: for the BIOS of old
  put(boot, 26, std::uint16_t{255});
  boot[36] = 0x80;
  boot[38] = 0x29;
  put(boot, 39, options.volume_id);
  put_text(boot, 43, options.label, 11);
  put_text(boot, 54, layout.fat_bits == 12 ? "FAT12" : "FAT16", 8);
  boot[62] = 0xEB;  // there is nothing to boot
  boot[63] = 0xFE;
  boot[510] = 0x55;
  boot[511] = 0xAA;
  return boot;
}

class Table {
 public:
  explicit Table(const Layout& layout)
      : bits_(layout.fat_bits), bytes_(std::size_t{layout.fat_blocks} * kBlockBytes, 0) {
    set(0, 0xFF00U | kFixedDisk);
    set(1, 0xFFFF);
  }
  void chain(std::uint32_t first, std::uint32_t clusters) {
    for (std::uint32_t i = 0; i < clusters; ++i) {
      set(first + i, i + 1 < clusters ? first + i + 1 : 0xFFFFU);
    }
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  void set(std::uint32_t cluster, std::uint32_t value) {
    if (bits_ == 16) {
      put(bytes_, std::size_t{cluster} * 2, static_cast<std::uint16_t>(value));
      return;
    }
    // Two entries share three bytes.
    const std::size_t at = std::size_t{cluster} * 3 / 2;
    const std::uint32_t twelve = value & 0xFFFU;
    if (cluster % 2 == 0) {
      bytes_[at] = static_cast<std::uint8_t>(twelve & 0xFFU);
      bytes_[at + 1] = static_cast<std::uint8_t>((bytes_[at + 1] & 0xF0U) | (twelve >> 8U));
    } else {
      bytes_[at] = static_cast<std::uint8_t>((bytes_[at] & 0x0FU) | ((twelve << 4U) & 0xF0U));
      bytes_[at + 1] = static_cast<std::uint8_t>(twelve >> 4U);
    }
  }

  int bits_;
  Bytes bytes_;
};

}  // namespace

Result<FatImage> FatImage::make(const std::vector<FatFile>& files, const FatImageOptions& options) {
  const auto layout = lay_out(options.volume_bytes);
  if (!layout || options.label.size() > 11) {
    return fail(ErrorCode::usage, "no FAT12 or FAT16 volume has this size or label", options.label,
                "choose 64 KiB to 2 GiB, and a label of at most 11 characters");
  }
  // The root and the folders by name, each with its files.
  std::map<std::string, std::vector<const FatFile*>> folders;
  folders[""] = {};
  std::map<std::string, ShortName> names;
  const auto bad_name = [](const std::string& path) {
    return fail(ErrorCode::usage, "the volume cannot hold a file of this name", path,
                "use names of 8.3 characters, once each, in one level of folders");
  };
  for (const FatFile& file : files) {
    const std::size_t slash = file.path.find('/');
    const std::string folder =
        slash == std::string::npos ? std::string() : file.path.substr(0, slash);
    const auto name =
        short_name(std::string_view(file.path).substr(slash == std::string::npos ? 0 : slash + 1));
    const auto folder_name = short_name(folder.empty() ? "ROOT" : folder);
    if (!name || !folder_name || (slash == 0) || !names.emplace(file.path, *name).second ||
        file.content == nullptr || file.content->size() > 0xFFFFFFFFU) {
      return bad_name(file.path);
    }
    if (!folder.empty()) {
      names.emplace(folder + "/", *folder_name);
    }
    folders[folder].push_back(&file);
  }
  // The name on the medium, without its case, must be one of a kind in its folder.
  std::map<std::string, int> seen;
  for (const auto& [path, name] : names) {
    const std::size_t slash = path.find('/');
    const bool inside = slash != std::string::npos && slash + 1 < path.size();
    if (seen[(inside ? path.substr(0, slash) + "/" : std::string()) + name.padded]++ != 0) {
      return bad_name(path);
    }
  }

  FatImage image;
  image.blocks_ = layout->blocks;
  image.fat_bits_ = layout->fat_bits;
  Table table(*layout);
  std::uint32_t next_cluster = 2;
  const auto place = [&](std::shared_ptr<const Bytes> content) -> std::optional<std::uint32_t> {
    const std::uint64_t cluster_bytes = std::uint64_t{layout->blocks_per_cluster} * kBlockBytes;
    const std::uint64_t clusters = (content->size() + cluster_bytes - 1) / cluster_bytes;
    if (clusters == 0) {
      return 0;
    }
    if (clusters > layout->clusters + 2ULL - next_cluster) {
      return std::nullopt;
    }
    const std::uint32_t first = next_cluster;
    table.chain(first, static_cast<std::uint32_t>(clusters));
    image.extents_.push_back({layout->data_start() + (first - 2) * layout->blocks_per_cluster,
                              static_cast<std::uint32_t>(clusters) * layout->blocks_per_cluster,
                              std::move(content)});
    next_cluster += static_cast<std::uint32_t>(clusters);
    return first;
  };
  const auto full = [&] {
    return fail(ErrorCode::configuration, "the files do not fit into the volume", options.label,
                "make the volume larger or the recordings shorter");
  };
  const auto entries_of = [&](const std::string& folder) -> std::optional<std::vector<Entry>> {
    std::vector<Entry> entries;
    for (const FatFile* file : folders[folder]) {
      const auto cluster = place(file->content);
      if (!cluster) {
        return std::nullopt;
      }
      const ShortName& name = names.at(file->path);
      entries.push_back({name.padded, name.case_flags, kAttributeReadOnly, file->modified, *cluster,
                         static_cast<std::uint32_t>(file->content->size())});
    }
    return entries;
  };

  auto root = entries_of("");
  if (!root) {
    return full();
  }
  root->insert(root->begin(), Entry{options.label + std::string(11 - options.label.size(), ' '),
                                    0,
                                    kAttributeLabel,
                                    {},
                                    0,
                                    0});
  for (const auto& [folder, inside] : folders) {
    if (folder.empty()) {
      continue;
    }
    auto entries = entries_of(folder);
    if (!entries) {
      return full();
    }
    // The folder lies behind its files; its own cluster is known before it is written.
    const std::uint32_t own = next_cluster;
    const UtcTime modified = inside.front()->modified;
    entries->insert(entries->begin(), {{".          ", 0, kAttributeFolder, modified, own, 0},
                                       {"..         ", 0, kAttributeFolder, modified, 0, 0}});
    auto bytes = std::make_shared<Bytes>(entries->size() * kEntryBytes, std::uint8_t{0});
    for (std::size_t i = 0; i < entries->size(); ++i) {
      put_entry(*bytes, i * kEntryBytes, (*entries)[i]);
    }
    if (!place(bytes)) {
      return full();
    }
    const ShortName& name = names.at(folder + "/");
    root->push_back({name.padded, name.case_flags, kAttributeFolder, modified, own, 0});
  }
  if (root->size() > kRootEntries) {
    return full();
  }

  image.head_ = boot_block(*layout, options);
  for (int copy = 0; copy < 2; ++copy) {
    image.head_.insert(image.head_.end(), table.bytes().begin(), table.bytes().end());
  }
  const std::size_t root_at = image.head_.size();
  image.head_.resize(root_at + std::size_t{kRootBlocks} * kBlockBytes, 0);
  for (std::size_t i = 0; i < root->size(); ++i) {
    put_entry(image.head_, root_at + i * kEntryBytes, (*root)[i]);
  }
  return image;
}

void FatImage::read(std::uint32_t block, std::span<std::uint8_t, kBlockBytes> out) const {
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  const auto copy = [&out](const Bytes& from, std::size_t at) {
    if (at < from.size()) {
      const auto begin = from.begin() + static_cast<std::ptrdiff_t>(at);
      std::copy_n(begin, std::min(kBlockBytes, from.size() - at), out.begin());
    }
  };
  if (std::size_t{block} * kBlockBytes < head_.size()) {
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
