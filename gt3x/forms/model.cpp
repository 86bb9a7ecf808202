#include "gt3x/forms/model.h"

#include <algorithm>
#include <array>

#include "base/serial.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::string_view kUnknown = "unknown";

struct Family {
  std::string_view prefix;
  std::string_view model;
  std::optional<double> accel_scale_lsb_per_g;
};

// The first prefix that fits holds.
constexpr std::array<Family, 9> kFamilies = {{
    {"NEO", "GT3X+", 341},
    {"CLE", "wGT3X+", 341},
    {"MRA", "ActiSleep+", 341},
    {"MOS0", "wGT3X-BT", 256},
    {"MOS2", "wGT3X-BT", 256},
    {"MOS3", "wActiSleep+", 256},
    {"MOS4", "wActiSleep-BT", 256},
    {"MOS", "wGT3X-BT family", 256},
    {"TAS", "GT9X Link", 256},
}};

// Some files have the serial number in lower case.
bool begins_with(std::string_view serial, std::string_view prefix) {
  return serial.size() >= prefix.size() &&
         std::equal(prefix.begin(), prefix.end(), serial.begin(),
                    [](char a, char b) { return a == b || (b >= 'a' && a == b - 'a' + 'A'); });
}

const Family* family_of(std::string_view serial) {
  for (const Family& family : kFamilies) {
    if (begins_with(serial, family.prefix)) {
      return &family;
    }
  }
  return nullptr;
}

}  // namespace

std::string_view model_of(std::string_view serial) {
  if (begins_with(serial, "CPW")) {
    return "CentrePoint Insight Watch";
  }
  const Family* family = family_of(serial);
  return family != nullptr ? family->model : kUnknown;
}

std::string unit_serial(std::string_view serial) {
  std::string unit(serial);
  for (char& c : unit) {
    const bool small = c >= 'a' && c <= 'z';
    if (!small && !(c >= 'A' && c <= 'Z') && !(c >= '0' && c <= '9')) {
      return std::string(serial);
    }
    c = small ? static_cast<char>(c - 'a' + 'A') : c;
  }
  return is_serial(unit) && model_of(unit) != kUnknown ? unit : std::string(serial);
}

std::optional<double> default_accel_scale_lsb_per_g(std::string_view serial) {
  const Family* family = family_of(serial);
  return family != nullptr ? family->accel_scale_lsb_per_g : std::nullopt;
}

}  // namespace sixpoint::gt3x
