#include "gt3x/forms/sample_rate.h"

#include <fmt/format.h>

namespace sixpoint::gt3x {

Result<double> usable_sample_rate_hz(const Info& info, const std::string& path, double most_hz) {
  const auto text = info.get("Sample Rate");
  const double rate_hz = text ? parse_decimal(*text).value_or(0) : 0;
  if (rate_hz >= 1 && rate_hz <= most_hz) {
    return rate_hz;
  }
  std::string what = "info.txt names no sample rate";
  if (text) {
    what = fmt::format("info.txt gives a sample rate of '{}', which is not from 1 to {} Hz",
                       printable(*text, 40), most_hz);
  }
  return fail(ErrorCode::bad_data, std::move(what), path,
              "download the recording from the unit again");
}

}  // namespace sixpoint::gt3x
