// Constants as a file: what is accepted is valid, and written again it is read as the same.
#include <cstdlib>
#include <string_view>

#include <nlohmann/json.hpp>

#include "calib/constants.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const auto record = calib::parse_constants_record({reinterpret_cast<const char*>(data), size});
  if (!record) {
    return 0;
  }
  if (!calib::validate(record->calibration) || !calib::validate(record->stored)) {
    std::abort();
  }
  const auto again = calib::parse_constants_record(calib::to_json(*record).dump());
  if (!again || again->serial != record->serial || again->filter != record->filter ||
      again->calibration.zero_lsb != record->calibration.zero_lsb ||
      again->calibration.sensitivity_g_per_lsb != record->calibration.sensitivity_g_per_lsb) {
    std::abort();
  }
  return 0;
}
