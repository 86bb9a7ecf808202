// Little-endian fields in and out of a payload, with every length checked.
//
//   const Bytes payload = payload_of(std::uint8_t{0}, std::uint16_t{512});  // 00 00 02
//   PayloadReader reader(payload);
//   const auto page = reader.get<std::uint8_t>();
//   const auto length = reader.get<std::uint16_t>();  // 512; reader.finished() is true
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/env.h"
#include "base/serial.h"
#include "device/unit_types.h"

namespace sixpoint::device {

class PayloadWriter {
 public:
  template <std::integral Integer>
  PayloadWriter& put(Integer value) {
    auto rest = static_cast<std::make_unsigned_t<Integer>>(value);
    for (std::size_t i = 0; i < sizeof(Integer); ++i) {
      bytes_.push_back(static_cast<std::uint8_t>(rest & 0xFFU));
      if constexpr (sizeof(Integer) > 1) {
        rest = static_cast<std::make_unsigned_t<Integer>>(rest >> 8U);
      }
    }
    return *this;
  }
  PayloadWriter& put(std::span<const std::uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  // Cut or padded with zero bytes to `width`.
  PayloadWriter& put(std::string_view text, std::size_t width) {
    for (std::size_t i = 0; i < width; ++i) {
      bytes_.push_back(i < text.size() ? static_cast<std::uint8_t>(text[i]) : std::uint8_t{0});
    }
    return *this;
  }
  Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

// Integers and spans of bytes, one behind the other.
template <class... Fields>
Bytes payload_of(const Fields&... fields) {
  PayloadWriter writer;
  (writer.put(fields), ...);
  return writer.take();
}

// Reads beyond the end give zeros and make ok() false: check once, at the end.
class PayloadReader {
 public:
  explicit PayloadReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class Integer>
  Integer get() {
    std::make_unsigned_t<Integer> value = 0;
    for (const std::uint8_t byte : take(sizeof(Integer))) {
      // Built from the top: the first byte is the lowest, and moves down as the others come.
      value = static_cast<std::make_unsigned_t<Integer>>(
          (static_cast<std::uint64_t>(byte) << (8 * (sizeof(Integer) - 1))) |
          (static_cast<std::uint64_t>(value) >> 8U));
    }
    return static_cast<Integer>(value);
  }
  std::span<const std::uint8_t> take(std::size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const auto part = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return part;
  }
  // Up to the first zero byte.
  std::string text(std::size_t width) {
    const auto part = take(width);
    return {part.begin(), std::find(part.begin(), part.end(), 0)};
  }
  std::size_t left() const { return bytes_.size(); }
  bool ok() const { return ok_; }
  bool finished() const { return ok_ && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool ok_ = true;
};

inline void put_names(PayloadWriter& writer, const DeviceNames& names) {
  writer.put(names.serial, 16).put(names.firmware, 12).put(names.model, 12);
}
// False where they hold characters that no device has.
inline bool get_names(PayloadReader& reader, DeviceNames& names) {
  names.serial = reader.text(16);
  names.firmware = reader.text(12);
  names.model = reader.text(12);
  return is_serial(names.serial) && is_name(names.firmware) && is_name(names.model);
}

}  // namespace sixpoint::device
