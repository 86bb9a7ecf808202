// The numbers of the zip format that its reader and its writer share (private to this room).
// Source: PKWARE, APPNOTE.TXT 6.3, 4.3 (signatures), 4.4.4 (flags) and 4.5.3 (zip64).
//
//   const bool entry_begins = number_at(header, 0, 4) == zip::kLocalHeader;
#pragma once

#include <cstdint>

namespace sixpoint::gt3x::zip {

inline constexpr std::uint32_t kLocalHeader = 0x04034b50;
inline constexpr std::uint32_t kDescriptor = 0x08074b50;
inline constexpr std::uint32_t kCentralHeader = 0x02014b50;
inline constexpr std::uint32_t kEnd = 0x06054b50;
inline constexpr std::uint32_t kEnd64 = 0x06064b50;
inline constexpr std::uint32_t kEnd64Locator = 0x07064b50;

// A flag: sizes and CRC stand in a descriptor behind the entry.
inline constexpr std::uint16_t kDescribedBehind = 1U << 3U;

// The extra field that holds what does not fit into 32 bits, and what then stands in the 32 bits.
inline constexpr std::uint16_t kZip64Id = 1;
inline constexpr std::uint32_t kSee64 = 0xFFFFFFFF;

}  // namespace sixpoint::gt3x::zip
