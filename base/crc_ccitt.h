// The check value of the GT3X family's memory and of the wire protocol.
//
//   crc_ccitt(as_bytes("123456789"));  // 0x29B1
#pragma once

#include <cstdint>
#include <span>

namespace sixpoint {

// CRC-CCITT: polynomial x^16 + x^12 + x^5 + 1, from all ones, most significant bit first. Pure
// function; any thread.
std::uint16_t crc_ccitt(std::span<const std::uint8_t> bytes);

}  // namespace sixpoint
