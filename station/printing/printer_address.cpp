#include "station/printing/printer_address.h"

#include <algorithm>
#include <cctype>
#include <charconv>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

constexpr std::size_t kMostPath = 1024;
constexpr std::size_t kMostHost = 253;  // RFC 1035

bool is_all_of(std::string_view text, std::string_view punctuation) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           punctuation.find(c) != std::string_view::npos;
  });
}

bool is_device_path(std::string_view text) {
  const bool plain = std::none_of(text.begin(), text.end(), [](char c) {
    return std::iscntrl(static_cast<unsigned char>(c)) != 0;
  });
  const std::string closed = std::string(text) + "/";
  return plain && text.starts_with('/') && text.size() <= kMostPath && !text.ends_with('/') &&
         closed.find("/../") == std::string::npos;
}

}  // namespace

std::string PrinterAddress::text() const {
  if (!device.empty()) {
    return device;
  }
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return is_ipv6 ? fmt::format("tcp://[{}]:{}", host, port)
                 : fmt::format("tcp://{}:{}", host, port);
}

Result<PrinterAddress> parse_printer(const std::string& text) {
  const auto refuse = [&] {
    return fail(ErrorCode::usage, "this is no printer", printable(text, 80),
                "name a device as /dev/usb/lp0, or a printer in the network as tcp://HOST:9100");
  };
  constexpr std::string_view kTcp = "tcp://";
  PrinterAddress printer;
  if (!text.starts_with(kTcp)) {
    if (!is_device_path(text)) {
      return refuse();
    }
    printer.device = text;
    return printer;
  }
  const std::string_view rest = std::string_view(text).substr(kTcp.size());
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) {
    return refuse();
  }
  std::string_view host = rest.substr(0, colon);
  const std::string_view port = rest.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), printer.port);
  if (error != std::errc() || end != port.data() + port.size() || printer.port == 0) {
    return refuse();
  }
  const bool is_ipv6 = host.starts_with('[') && host.ends_with(']') && host.size() > 2;
  if (is_ipv6) {
    host = host.substr(1, host.size() - 2);
  }
  if (host.size() > kMostHost || !is_all_of(host, is_ipv6 ? ":." : ".-") || host.starts_with('-')) {
    return refuse();
  }
  printer.host = host;
  return printer;
}

Status check_printer(FileSystem& files, const PrinterAddress& printer) {
  if (printer.device.empty()) {
    return {};
  }
  const auto info = files.info(printer.device);
  if (info && info->kind != FileKind::device && info->kind != FileKind::pipe) {
    return fail(ErrorCode::usage, "this is no printer, and labels would be written into it",
                printable(printer.device, 200),
                "name the printer's device, for example /dev/usb/lp0");
  }
  return {};
}

}  // namespace sixpoint::station
