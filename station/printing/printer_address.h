// Where labels are printed: what `--printer` takes.
//
//   SIXPOINT_ASSIGN(const PrinterAddress printer, parse_printer("tcp://label-printer:9100"));
//   std::cout << printer.text();
//
// | text                 | printer                                                            |
// |----------------------|--------------------------------------------------------------------|
// | /dev/usb/lp0         | a device of characters, or a pipe that another program reads       |
// | tcp://HOST:PORT      | raw data over TCP, 9100 on most; HOST is a name or IPv4            |
// | tcp://[ADDRESS]:PORT | likewise, IPv6                                                     |
// | any other            | usage: relative paths, "..", control characters, users, passwords, |
// |                      | paths or queries after the port, port 0 or above 65535             |
//
// Pure functions, but check_printer().
#pragma once

#include <cstdint>
#include <string>

#include "base/env.h"
#include "base/result.h"

namespace sixpoint::station {

struct PrinterAddress {
  std::string device;  // empty: TCP
  std::string host;    // without brackets
  std::uint16_t port = 0;

  std::string text() const;  // as it was given
};

Result<PrinterAddress> parse_printer(const std::string& text);

// usage where the path names a file, a folder, a disk or a socket: a label would go into it. A
// device that is not there yet is no error: printers are switched off.
Status check_printer(FileSystem& files, const PrinterAddress& printer);

}  // namespace sixpoint::station
