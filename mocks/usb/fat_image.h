// A read-only FAT volume made in memory, as the flash of a unit shows it to a file manager.
//
//   SIXPOINT_ASSIGN(const FatImage volume,
//                   FatImage::make({{"info.txt", text, modified}, {"log.bin", log, modified}}));
//   std::array<std::uint8_t, kBlockBytes> block{};
//   volume.read(0, block);  // the boot sector
//
// FAT16 of 96 MiB with clusters of 2 KiB and the label SIXPOINT, without a partition table. The
// contents stay where they are: an empty volume needs a few kilobytes of memory.
// It is made here and not by mkfs.vfat, because `sixpoint virtual` offers it at run time.
// Layout: Microsoft, "FAT32 File System Specification" 1.03 (FAT16 parts).
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
  // "info.txt" or "REC00001/info.txt": at most one folder, names of at most 8.3 characters, each in
  // one case.
  std::string path;
  std::shared_ptr<const Bytes> content;
  UtcTime modified;  // years 1980 to 2107; others become the nearest
};

class FatImage final : public BlockMedium {
 public:
  // configuration when the files do not fit. Precondition: different paths of the form above.
  static Result<FatImage> make(const std::vector<FatFile>& files);

  std::uint32_t blocks() const override;
  void read(std::uint32_t block, std::span<std::uint8_t, kBlockBytes> out) const override;

 private:
  struct Extent {
    std::uint32_t first_block;
    std::uint32_t blocks;
    std::shared_ptr<const Bytes> content;
  };
  class Builder;

  Bytes head_;                   // boot sector, both FATs, root folder
  std::vector<Extent> extents_;  // folders and files, in the order of blocks
};

}  // namespace sixpoint::mocks
