// Bytes that are pulled, piece by piece: how log.bin comes out of a zip and goes into one.
//
//   MemorySource source(Bytes{0x1E, 0x06});
//   SIXPOINT_ASSIGN(const Bytes bytes, read_all(source, 1 << 20));  // at most 1 MiB
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/env.h"

namespace sixpoint::gt3x {

// One object belongs to one thread.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  // Puts up to out.size() bytes into `out` and returns how many; 0 is the end (out is never empty).
  // At the end of a zip entry this is also where a wrong CRC is reported: only who has read to the
  // end knows that what came before was right.
  virtual Result<std::size_t> read(std::span<std::uint8_t> out) = 0;
  // How many bytes there are in all, where that is known beforehand.
  virtual std::optional<std::uint64_t> size() const { return std::nullopt; }
};

class MemorySource final : public ByteSource {
 public:
  explicit MemorySource(Bytes bytes) : bytes_(std::move(bytes)) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override;
  std::optional<std::uint64_t> size() const override { return bytes_.size(); }

 private:
  Bytes bytes_;
  std::size_t at_ = 0;
};

// Everything that is left; bad_data above `limit` bytes.
Result<Bytes> read_all(ByteSource& source, std::uint64_t limit);

}  // namespace sixpoint::gt3x
