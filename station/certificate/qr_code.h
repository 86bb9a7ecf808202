// A QR code as a square of modules.
#pragma once

#include <string_view>
#include <vector>

#include "base/result.h"

namespace sixpoint::station {

struct QrCode {
  std::size_t size = 0;    // modules along a side, without the quiet zone of four
  std::vector<bool> dark;  // row by row
  bool at(std::size_t row, std::size_t column) const { return dark[row * size + column]; }
};

// Error correction M (15 %). bad_data for a text that does not fit (2331 bytes).
Result<QrCode> qr_code(std::string_view text);

}  // namespace sixpoint::station
