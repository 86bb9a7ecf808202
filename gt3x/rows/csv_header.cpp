#include "gt3x/rows/csv_header.h"

#include <chrono>

#include <fmt/format.h>

namespace sixpoint::gt3x {
namespace {

std::string clock_text(UtcTime time) {
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::seconds>(time - day));
  return fmt::format("{:02}:{:02}:{:02}", clock.hours().count(), clock.minutes().count(),
                     clock.seconds().count());
}

std::string date_text(UtcTime time) {
  const std::chrono::year_month_day date(std::chrono::floor<std::chrono::days>(time));
  return fmt::format("{}/{}/{}", static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()), static_cast<int>(date.year()));
}

}  // namespace

std::string csv_header(const Info& info, std::string_view made_by, std::uint32_t start_time) {
  const UtcTime start = from_unix_seconds(start_time);
  const UtcTime download = info.download().value_or(start);
  std::string battery(info.get("Battery Voltage").value_or("0"));
  for (char& c : battery) {
    c = c == ',' ? '.' : c;
  }
  return fmt::format(
      "------------ Data File {}-----------\r\n"
      "Serial Number: {}\r\nStart Time {}\r\nStart Date {}\r\n"
      "Epoch Period (hh:mm:ss) 00:00:00\r\nDownload Time {}\r\nDownload Date {}\r\n"
      "Current Memory Address: 0\r\nCurrent Battery Voltage: {}     Mode = 12\r\n"
      "--------------------------------------------------\r\n",
      made_by, printable(info.serial(), 40), clock_text(start), date_text(start),
      clock_text(download), date_text(download), printable(battery, 40));
}

}  // namespace sixpoint::gt3x
