#include "device/wire/calibration_page.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "base/calibration_section.h"
#include "calib/constants.h"

namespace sixpoint::device {

namespace {

constexpr int kFirstYear = 2000;
constexpr int kLastYear = 2255;

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
  const std::chrono::year_month_day date(std::chrono::floor<std::chrono::days>(page.calibrated));
  if (date.year() < std::chrono::year(kFirstYear) || date.year() > std::chrono::year(kLastYear)) {
    return fail(ErrorCode::configuration, "the calibration date does not fit into the page",
                "calibration page", "set this computer's clock");
  }
  Bytes bytes(kPageBytes, 0xFF);
  if (before.size() == kPageBytes) {
    std::copy(before.begin(), before.end(), bytes.begin());
  }
  write_calibration_section({page.constants, page.calibrated}, bytes);
  return bytes;
}

Result<CalibrationPage> decode_calibration_page(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kPageBytes) {
    return no_page(fmt::format("the page has {} bytes, not {}", bytes.size(), kPageBytes));
  }
  const auto section = read_calibration_section(bytes);
  if (!section) {
    return no_page(section.error().what);
  }
  if (const Status valid = calib::validate(section->constants); !valid) {
    return no_page(valid.error().what);
  }
  if (!section->calibrated) {
    return no_page("the page's date does not exist");
  }
  return CalibrationPage{section->constants, *section->calibrated};
}

}  // namespace sixpoint::device
