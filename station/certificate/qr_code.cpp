// The one place that sees libqrencode.
#include "station/certificate/qr_code.h"

#include <memory>

#include <qrencode.h>

namespace sixpoint::station {

Result<QrCode> qr_code(std::string_view text) {
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> made(
      QRcode_encodeData(static_cast<int>(text.size()),
                        reinterpret_cast<const unsigned char*>(text.data()), 0, QR_ECLEVEL_M),
      &QRcode_free);
  if (!made || made->width <= 0) {
    return fail(ErrorCode::bad_data, "the text does not fit into a QR code", {},
                "a shorter one does");
  }
  QrCode code;
  code.size = static_cast<std::size_t>(made->width);
  for (std::size_t i = 0; i < code.size * code.size; ++i) {
    code.dark.push_back((made->data[i] & 1U) != 0);  // NOLINT(cppcoreguidelines-pro-bounds*)
  }
  return code;
}

}  // namespace sixpoint::station
