// Which unit a scanned label names.
//
//   const auto serial = serial_of_label("sixpoint:MOS2A45130007:0f3a");  // "MOS2A45130007"
//
// | what was scanned or typed                                     | serial number                |
// |---------------------------------------------------------------|------------------------------|
// | the QR code of our labels: sixpoint:SERIAL:RUN, RUN in hex    | SERIAL, in capital letters   |
// | a serial number (base/serial.h), blanks around it             | itself, in capital letters   |
// | anything else: empty, too long, a colon, another code         | none                         |
//
// A pure function.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sixpoint::station {

std::optional<std::string> serial_of_label(std::string_view label);

}  // namespace sixpoint::station
