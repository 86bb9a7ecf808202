// What a unit or a jig can carry as its serial number.
//
//   is_serial("MOS2A12345678");   // true
//   is_serial("MOS 2");           // false: a blank
#pragma once

#include <algorithm>
#include <string_view>

namespace sixpoint {

inline constexpr std::size_t kLongestSerial = 16;

// Printable ASCII without blanks: what a USB descriptor and the project's protocol give as a name.
inline bool is_name(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7f'; });
}

// | text                                              | serial number |
// |---------------------------------------------------|---------------|
// | 1 to 16 characters, all printable ASCII, no blank | yes           |
// | empty, longer, a blank or another character       | no            |
//
// The store and the readers of recordings take more (db/records.h): files of other makers exist.
inline bool is_serial(std::string_view text) {
  return !text.empty() && text.size() <= kLongestSerial && is_name(text);
}

}  // namespace sixpoint
