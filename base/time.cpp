#include "base/time.h"

#include <array>
#include <charconv>

#include <fmt/format.h>

namespace sixpoint {

UtcTime from_unix_seconds(std::int64_t seconds) { return UtcTime(std::chrono::seconds(seconds)); }

std::int64_t to_unix_seconds(UtcTime time) {
  return std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
}

std::string to_iso8601(UtcTime time) {
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(time - day);
  std::string text =
      fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  clock.hours().count(), clock.minutes().count(), clock.seconds().count());
  if (const auto fraction_ns = clock.subseconds().count(); fraction_ns != 0) {
    std::string digits = fmt::format("{:09}", fraction_ns);
    digits.erase(digits.find_last_not_of('0') + 1);
    text += "." + digits;
  }
  return text + "Z";
}

Result<UtcTime> parse_iso8601(std::string_view text) {
  const auto wrong = [&] {
    return fail(ErrorCode::bad_data, fmt::format("'{}' is not a date", printable(text, 60)), {},
                "write it as 2013-11-12 or 2013-11-12T10:00:00Z");
  };
  std::string_view rest = text;
  if (rest.ends_with('Z')) {
    rest.remove_suffix(1);
  }
  // A fraction of a second: up to nine digits behind a point.
  std::int64_t fraction_ns = 0;
  if (const auto point = rest.find('.'); point != std::string_view::npos) {
    const std::string_view digits = rest.substr(point + 1);
    if (point != 19 || digits.empty() || digits.size() > 9) {
      return wrong();
    }
    for (std::size_t i = 0; i < 9; ++i) {
      const char digit = i < digits.size() ? digits[i] : '0';
      if (digit < '0' || digit > '9') {
        return wrong();
      }
      fraction_ns = fraction_ns * 10 + (digit - '0');
    }
    rest = rest.substr(0, point);
  }
  // Field starts and widths of YYYY-MM-DD[THH:MM:SS].
  constexpr std::array<std::size_t, 6> kStart = {0, 5, 8, 11, 14, 17};
  constexpr std::array<std::size_t, 6> kWidth = {4, 2, 2, 2, 2, 2};
  constexpr std::string_view kForm = "0000-00-00T00:00:00";
  if (rest.size() != 10 && rest.size() != kForm.size()) {
    return wrong();
  }
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const bool digit = rest[i] >= '0' && rest[i] <= '9';
    if (kForm[i] == '0' ? !digit : rest[i] != kForm[i]) {
      return wrong();
    }
  }
  std::array<int, 6> field{};
  for (std::size_t i = 0; i < kStart.size() && kStart[i] < rest.size(); ++i) {
    const char* begin = rest.data() + kStart[i];
    std::from_chars(begin, begin + kWidth[i], field[i]);
  }
  const std::chrono::year_month_day date(std::chrono::year(field[0]),
                                         std::chrono::month(static_cast<unsigned>(field[1])),
                                         std::chrono::day(static_cast<unsigned>(field[2])));
  // Nanoseconds in 64 bits reach from 1677 to 2262.
  if (!date.ok() || field[0] < 1700 || field[0] > 2250 || field[3] > 23 || field[4] > 59 ||
      field[5] > 59) {
    return wrong();
  }
  return UtcTime(std::chrono::sys_days(date)) + std::chrono::hours(field[3]) +
         std::chrono::minutes(field[4]) + std::chrono::seconds(field[5]) +
         std::chrono::nanoseconds(fraction_ns);
}

}  // namespace sixpoint
