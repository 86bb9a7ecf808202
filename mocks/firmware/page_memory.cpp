#include "mocks/firmware/page_memory.h"

#include <algorithm>

#include "base/crc_ccitt.h"

namespace sixpoint::mocks {

namespace {

constexpr std::uint8_t kErased = 0xFF;
constexpr std::uint8_t kSealed = 0xA5;
constexpr std::size_t kGeneration = device::kPageBytes;
constexpr std::size_t kCrc = kGeneration + 4;
constexpr std::size_t kMark = kCrc + 2;

}  // namespace

PageMemory::PageMemory(std::span<const std::uint8_t> page) {
  for (Bank& bank : banks_) {
    bank.fill(kErased);
  }
  write(page);
  bytes_written_ = 0;
}

std::optional<std::uint32_t> PageMemory::generation(const Bank& bank) {
  const std::uint16_t crc = crc_ccitt(std::span(bank).first(kCrc));
  if (bank[kMark] != kSealed || bank[kCrc] != (crc & 0xFFU) || bank[kCrc + 1] != (crc >> 8U)) {
    return std::nullopt;
  }
  std::uint32_t generation = 0;
  for (std::size_t i = 4; i-- > 0;) {
    generation = (generation << 8U) | bank[kGeneration + i];
  }
  return generation;
}

std::optional<std::size_t> PageMemory::bank_in_force() const {
  const auto first = generation(banks_[0]);
  const auto second = generation(banks_[1]);
  if (!first && !second) {
    return std::nullopt;
  }
  return second && (!first || *second > *first) ? 1 : 0;
}

std::optional<Bytes> PageMemory::read() const {
  const auto bank = bank_in_force();
  if (!bank) {
    return std::nullopt;
  }
  return Bytes(banks_[*bank].begin(), banks_[*bank].begin() + device::kPageBytes);
}

bool PageMemory::put(Bank& bank, std::size_t offset, std::uint8_t value) {
  if (power_left_) {
    if (*power_left_ == 0) {
      return false;
    }
    --*power_left_;
  }
  bank[offset] = value;
  ++bytes_written_;
  return true;
}

bool PageMemory::write(std::span<const std::uint8_t> page) {
  const auto in_force = bank_in_force();
  const std::uint32_t next = in_force ? *generation(banks_[*in_force]) + 1 : 1;
  Bank& bank = banks_[in_force ? 1 - *in_force : 0];
  // The mark goes first, so that no moment leaves an old seal over a half-written page.
  if (!put(bank, kMark, kErased)) {
    return false;
  }
  for (std::size_t i = 0; i < device::kPageBytes; ++i) {
    if (!put(bank, i, i < page.size() ? page[i] : kErased)) {
      return false;
    }
  }
  for (std::size_t i = 0; i < 4; ++i) {
    if (!put(bank, kGeneration + i, static_cast<std::uint8_t>((next >> (8 * i)) & 0xFFU))) {
      return false;
    }
  }
  const std::uint16_t crc = crc_ccitt(std::span(bank).first(kCrc));
  if (!put(bank, kCrc, static_cast<std::uint8_t>(crc & 0xFFU)) ||
      !put(bank, kCrc + 1, static_cast<std::uint8_t>(crc >> 8U))) {
    return false;
  }
  if (!std::equal(page.begin(), page.end(), bank.begin())) {
    return false;
  }
  return put(bank, kMark, kSealed);
}

void PageMemory::corrupt(std::size_t offset, std::uint8_t bits) {
  if (const auto bank = bank_in_force(); bank && offset < device::kPageBytes) {
    banks_[*bank][offset] = static_cast<std::uint8_t>(banks_[*bank][offset] ^ bits);
  }
}

}  // namespace sixpoint::mocks
