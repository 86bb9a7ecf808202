// Sends one label to a printer, and says whether the printer took all of it.
//
//   const Result<Sent> sent = send_label(printer, "^XA^FDhello^FS^XZ\n", stop, 15);
//
// | printer                                                  | answer                              |
// |----------------------------------------------------------|-------------------------------------|
// | network: closes the connection after the last byte       | taken                               |
// | network: has all bytes, and does not close in time       | unconfirmed: it may be out of paper |
// | network: closes or resets before the last byte           | an error: to be sent again          |
// | network: refuses, does not answer, does not read in time | an error                            |
// | device: took all bytes, and is ready for more            | taken                               |
// | device: is not there, goes away, is not ready in time    | an error                            |
// | device: is a file, a folder or a disk                    | an error                            |
//
// Uses sockets and devices. May be called from any thread.
#pragma once

#include <stop_token>
#include <string_view>

#include "base/result.h"
#include "station/printing/printer_address.h"

namespace sixpoint::station {

enum class Sent { taken, unconfirmed };

// device_unavailable with the reason where the label was not taken within `time_out_s`, or a stop
// was asked for. Only the look-up of a host's name may take longer, as the system's resolver does.
Result<Sent> send_label(const PrinterAddress& printer, std::string_view zpl,
                        const std::stop_token& stop, double time_out_s);

}  // namespace sixpoint::station
