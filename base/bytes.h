// Bytes, and the same bytes as text and as hexadecimal digits.
//
//   const Bytes bytes = {0x53, 0x31};
//   as_text(bytes);             // "S1": a view of the same memory, valid as long as `bytes` is
//   as_bytes("S1");             // and back
//   to_hex(bytes);              // "5331"
//   from_hex("5331").value();   // the bytes again
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sixpoint {

using Bytes = std::vector<std::uint8_t>;

inline std::string_view as_text(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
inline std::span<const std::uint8_t> as_bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string to_hex(std::span<const std::uint8_t> bytes);  // lower case
// Nothing where the text has an odd length or another character than 0-9 and a-f.
std::optional<Bytes> from_hex(std::string_view text);

// Without their line ends; the last line may lack its own. Views of `text`.
std::vector<std::string_view> lines_of(std::string_view text);

}  // namespace sixpoint
