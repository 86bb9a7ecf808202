#include "device/wire/calibration_page.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "calib/constants.h"
#include "device/wire/payload.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

namespace {

constexpr std::size_t kTune = 256;
constexpr std::size_t kCrc = 510;
constexpr int kFirstYear = 2000;

tl::unexpected<Error> no_page(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), "calibration page",
              "do not use this unit's constants; calibrate it on the jig and write the page anew");
}

}  // namespace

Result<Bytes> encode_calibration_page(const CalibrationPage& page,
                                      std::span<const std::uint8_t> before) {
  if (const Status valid = calib::validate(page.constants); !valid) {
    return fail(ErrorCode::configuration, valid.error().what, "calibration page",
                "only constants of a finished calibration can be written");
  }
  const auto day = std::chrono::floor<std::chrono::days>(page.calibrated);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(std::chrono::floor<std::chrono::seconds>(page.calibrated - day));
  const int year = static_cast<int>(date.year()) - kFirstYear;
  if (year < 0 || year > 255) {
    return fail(ErrorCode::configuration, "the calibration date does not fit into the page",
                "calibration page", "set this computer's clock");
  }
  PayloadWriter writer;
  writer.put(std::string_view("TUNE"), 4);
  for (const auto& axes :
       {page.constants.zero_lsb, page.constants.positive_lsb, page.constants.negative_lsb}) {
    for (const int lsb : axes) {
      writer.put(static_cast<std::int16_t>(lsb));
    }
  }
  writer.put(static_cast<std::uint8_t>(static_cast<unsigned>(date.month())))
      .put(static_cast<std::uint8_t>(static_cast<unsigned>(date.day())))
      .put(static_cast<std::uint8_t>(year))
      .put(static_cast<std::uint8_t>(time.hours().count()))
      .put(static_cast<std::uint8_t>(time.minutes().count()))
      .put(static_cast<std::uint8_t>(time.seconds().count()));
  const Bytes section = writer.take();
  Bytes bytes(kPageBytes, 0xFF);
  if (before.size() == kPageBytes) {
    std::copy(before.begin(), before.end(), bytes.begin());
  }
  std::copy(section.begin(), section.end(), bytes.begin() + kTune);
  const std::uint16_t crc = crc_ccitt(std::span(bytes).subspan(kTune, kCrc - kTune));
  bytes[kCrc] = static_cast<std::uint8_t>(crc >> 8U);
  bytes[kCrc + 1] = static_cast<std::uint8_t>(crc & 0xFFU);
  return bytes;
}

Result<CalibrationPage> decode_calibration_page(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kPageBytes) {
    return no_page(fmt::format("the page has {} bytes, not {}", bytes.size(), kPageBytes));
  }
  const auto stored = static_cast<std::uint16_t>((bytes[kCrc] << 8U) | bytes[kCrc + 1]);
  if (stored != crc_ccitt(bytes.subspan(kTune, kCrc - kTune))) {
    return no_page("the page's CRC is wrong");
  }
  PayloadReader reader(bytes.subspan(kTune, kCrc - kTune));
  if (reader.text(4) != "TUNE") {
    return no_page("the page holds no calibration");
  }
  CalibrationPage page;
  for (auto* axes :
       {&page.constants.zero_lsb, &page.constants.positive_lsb, &page.constants.negative_lsb}) {
    for (int& lsb : *axes) {
      lsb = reader.get<std::int16_t>();
    }
  }
  const unsigned month = reader.get<std::uint8_t>();
  const unsigned day = reader.get<std::uint8_t>();
  const int year = kFirstYear + reader.get<std::uint8_t>();
  const int hour = reader.get<std::uint8_t>();
  const int minute = reader.get<std::uint8_t>();
  const int second = reader.get<std::uint8_t>();
  if (const Status valid = calib::validate(page.constants); !valid) {
    return no_page(valid.error().what);
  }
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!date.ok() || hour > 23 || minute > 59 || second > 59) {
    return no_page("the page's date does not exist");
  }
  page.calibrated = std::chrono::sys_days(date) + std::chrono::hours(hour) +
                    std::chrono::minutes(minute) + std::chrono::seconds(second);
  return page;
}

}  // namespace sixpoint::device
