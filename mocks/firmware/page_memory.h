// The non-volatile memory of one page: two banks, so that a loss of power leaves the old page or
// the new one (docs/protocol.md, "Writing a page is a transaction").
//
//   PageMemory memory(page);
//   memory.cut_power_after(100);
//   memory.write(other_page);  // false: the old page is still in force
//
// Bytes are written one at a time, and power may fail before any of them: cut_power_after().
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "base/env.h"
#include "device/wire/calibration_page.h"

namespace sixpoint::mocks {

class PageMemory {
 public:
  explicit PageMemory(std::span<const std::uint8_t> page);

  // The page in force: that of the bank with a whole seal and the higher generation. Empty when no
  // bank has one (never after a power cut; only when corrupt() was used).
  std::optional<Bytes> read() const;

  // False when the power failed on the way, or the bank did not read back as written.
  bool write(std::span<const std::uint8_t> page);

  // The next `bytes` byte writes succeed; after them all fail until restore_power().
  void cut_power_after(std::uint64_t bytes) { power_left_ = bytes; }
  void restore_power() { power_left_.reset(); }
  bool has_power() const { return !power_left_ || *power_left_ > 0; }
  std::uint64_t bytes_written() const { return bytes_written_; }

  // Flips bits of the bank in force, as a worn cell would.
  void corrupt(std::size_t offset, std::uint8_t bits);

 private:
  // Seal: generation (4), CRC of page and generation (2), and a mark that is written last.
  static constexpr std::size_t kSealBytes = 7;
  using Bank = std::array<std::uint8_t, device::kPageBytes + kSealBytes>;

  bool put(Bank& bank, std::size_t offset, std::uint8_t value);
  static std::optional<std::uint32_t> generation(const Bank& bank);
  std::optional<std::size_t> bank_in_force() const;

  std::array<Bank, 2> banks_{};
  std::optional<std::uint64_t> power_left_;
  std::uint64_t bytes_written_ = 0;
};

}  // namespace sixpoint::mocks
