// The calibration page: what is decoded and written into the same page is decoded again the same.
#include <cstdlib>

#include "base/crc_ccitt.h"
#include "device/wire/calibration_page.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  Bytes bytes(data, data + size);
  static_cast<void>(device::decode_calibration_page(bytes));
  if (size != device::kPageBytes) {
    return 0;
  }
  // With the CRC put right, so that what lies behind it is reached.
  const std::uint16_t crc = crc_ccitt(std::span(bytes).subspan(256, 254));
  bytes[510] = static_cast<std::uint8_t>(crc >> 8U);
  bytes[511] = static_cast<std::uint8_t>(crc & 0xFFU);
  const auto page = device::decode_calibration_page(bytes);
  if (page) {
    const auto again = device::encode_calibration_page(*page, bytes);
    if (!again || *again != bytes) {
      std::abort();
    }
  }
  return 0;
}
