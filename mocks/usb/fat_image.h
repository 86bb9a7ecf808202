// A read-only FAT volume made in memory, as the flash of a unit shows it to a file manager.
//
// FAT12 or FAT16 by the number of clusters, without a partition table. Files lie one behind the
// other and stay where they are: a volume of 96 MiB that holds nothing needs a few kilobytes.
// Layout: Microsoft, "FAT32 File System Specification" 1.03 (FAT12 and FAT16 parts).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/time.h"

namespace sixpoint::mocks {

inline constexpr std::size_t kBlockBytes = 512;

// What a mass-storage device reads from. Const functions are safe from any thread.
class BlockMedium {
 public:
  virtual ~BlockMedium() = default;
  virtual std::uint32_t blocks() const = 0;
  // `block` is below blocks().
  virtual void read(std::uint32_t block, std::span<std::uint8_t, kBlockBytes> out) const = 0;
};

struct FatFile {
  // "info.txt" or "REC00001/info.txt": names of at most 8.3 characters, letters of one case in each
  // part, one level of folders.
  std::string path;
  std::shared_ptr<const Bytes> content;
  UtcTime modified;  // years 1980 to 2107; others become the nearest
};

struct FatImageOptions {
  std::string label = "SIXPOINT";    // at most 11 characters
  std::uint32_t volume_id = 0x36B0;  // shown by file managers
  // Unit flash of 64 MB and what log.bin is larger than its archive: FAT16 with clusters of 2 KiB.
  std::uint64_t volume_bytes = 96ULL << 20U;
};

class FatImage final : public BlockMedium {
 public:
  // usage when a name does not fit 8.3 or comes twice, or the size is none of FAT12 or FAT16;
  // configuration when the files do not fit.
  static Result<FatImage> make(const std::vector<FatFile>& files,
                               const FatImageOptions& options = {});

  std::uint32_t blocks() const override { return blocks_; }
  void read(std::uint32_t block, std::span<std::uint8_t, kBlockBytes> out) const override;
  int fat_bits() const { return fat_bits_; }

 private:
  struct Extent {
    std::uint32_t first_block;
    std::uint32_t blocks;
    std::shared_ptr<const Bytes> content;
  };
  std::uint32_t blocks_ = 0;
  int fat_bits_ = 16;
  Bytes head_;                   // boot sector, both FATs, root folder
  std::vector<Extent> extents_;  // folders and files, in the order of blocks
};

}  // namespace sixpoint::mocks
