#include "sim/firmware.h"

#include <charconv>
#include <cmath>

namespace sixpoint::sim {

namespace {

bool is_mos(std::string_view serial) { return serial.starts_with("MOS"); }

}  // namespace

std::optional<std::array<int, 3>> parse_version(std::string_view firmware) {
  std::array<int, 3> version{};
  const char* at = firmware.data();
  const char* const end = at + firmware.size();
  for (std::size_t part = 0; part < version.size(); ++part) {
    if (part > 0 && (at == end || *at++ != '.')) {
      return std::nullopt;
    }
    const auto [next, error] = std::from_chars(at, end, version[part]);
    if (error != std::errc() || version[part] < 0) {
      return std::nullopt;
    }
    at = next;
  }
  return at == end ? std::optional(version) : std::nullopt;
}

FilterConfiguration filter_of_constants(std::string_view serial, UtcTime calibrated) {
  return is_mos(serial) && calibrated < from_unix_seconds(kFilterChange_unix_s)
             ? FilterConfiguration::legacy
             : FilterConfiguration::current;
}

FilterConfiguration filter_of_recording(std::string_view serial, std::string_view firmware,
                                        UtcTime calibrated) {
  constexpr std::array<int, 3> kFirstWithout = {1, 4, 0};
  constexpr std::array<int, 3> kFirstRepaired = {1, 8, 0};
  const auto version = parse_version(firmware).value_or(std::array<int, 3>{});
  const bool lacks_check = version >= kFirstWithout && version < kFirstRepaired;
  return lacks_check ? FilterConfiguration::current : filter_of_constants(serial, calibrated);
}

bool turns_axes(std::string_view serial, std::string_view firmware) {
  return is_mos(serial) && parse_version(firmware) == std::array<int, 3>{1, 6, 0};
}

FirmwareScaler::FirmwareScaler(const UnitTruth& unit, int bits, const NumberFormat& format)
    : scale_lsb_per_g_(unit.accel_scale_lsb_per_g),
      low_(-std::ldexp(1.0, bits - 1)),
      high_(std::ldexp(1.0, bits - 1) - 1),
      turned_(turns_axes(unit.serial, unit.firmware)),
      format_(format) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const int range = unit.constants.positive_lsb[axis] - unit.constants.negative_lsb[axis];
    sensitivity_g_per_lsb_[axis] = range == 0 ? 0.0 : 2.0 / range;  // Eq. 1-3
    zero_lsb_[axis] = unit.constants.zero_lsb[axis];
  }
}

gt3x::Counts FirmwareScaler::store(const PerAxis<int>& raw_lsb) {
  PerAxis<double> scaled_lsb{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    // Eq. 4-6, then g to stored counts.
    const double scaled_g = sensitivity_g_per_lsb_[axis] * (raw_lsb[axis] - zero_lsb_[axis]);
    scaled_lsb[axis] = scaled_g * scale_lsb_per_g_;
  }
  if (turned_) {
    scaled_lsb = {-scaled_lsb[1], scaled_lsb[0], scaled_lsb[2]};
  }
  gt3x::Counts counts{};
  bool clipped = false;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    counts[axis] =
        static_cast<std::int16_t>(format_.to_integer(scaled_lsb[axis], low_, high_, clipped));
  }
  clipped_ += clipped ? 1 : 0;
  return counts;
}

}  // namespace sixpoint::sim
