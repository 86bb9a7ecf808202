// calibration.json and temperature_calibration.json of .agdc files: what is read gives finite
// numbers, or is refused.
#include <cmath>
#include <cstdlib>

#include "gt3x/forms/agdc.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const int rate_hz : {0, 32, 100}) {
    if (const auto calibration = gt3x::parse_agdc_calibration(text, rate_hz)) {
      for (const gt3x::Counts& counts :
           {gt3x::Counts{}, gt3x::Counts{-2048, 2047, 1}, gt3x::Counts{2047, -2048, -1}}) {
        for (const double value_g : calibration->apply(counts)) {
          if (std::isnan(value_g)) {
            std::abort();
          }
        }
      }
    }
  }
  if (const auto thermometer = gt3x::parse_temperature_calibration(text)) {
    static_cast<void>(thermometer->accelerometer_c(1000));
  }
  return 0;
}
