// Little-endian fields in and out of a payload, with every length checked.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/env.h"

namespace sixpoint::device {

class PayloadWriter {
 public:
  template <class Integer>
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

}  // namespace sixpoint::device
