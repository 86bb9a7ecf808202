// A QR code (ISO/IEC 18004) as a square of modules.
//
//   SIXPOINT_ASSIGN(const QrCode code, qr_code("sixpoint:SERIAL:RUN"));
//   code.at(0, 0);  // true: the corner of a finder pattern is dark
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
