#include "station/lanes/scan_rule.h"

#include "base/serial.h"

namespace sixpoint::station {

std::optional<std::string> serial_of_label(std::string_view label) {
  const std::size_t first = label.find_first_not_of(" \t");
  if (first == std::string_view::npos) {
    return std::nullopt;
  }
  label = label.substr(first, label.find_last_not_of(" \t") - first + 1);
  std::string capitals;
  for (const char c : label) {
    capitals += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  }
  std::string_view serial = capitals;
  constexpr std::string_view kOurs = "SIXPOINT:";
  if (serial.starts_with(kOurs)) {
    serial.remove_prefix(kOurs.size());
    const std::size_t colon = std::min(serial.find(':'), serial.size());
    const std::string_view run = serial.substr(std::min(colon + 1, serial.size()));
    if (run.empty() || run.find_first_not_of("0123456789ABCDEF") != std::string_view::npos) {
      return std::nullopt;
    }
    serial = serial.substr(0, colon);
  }
  if (!is_serial(serial) || serial.find(':') != std::string_view::npos) {
    return std::nullopt;
  }
  return std::string(serial);
}

}  // namespace sixpoint::station
