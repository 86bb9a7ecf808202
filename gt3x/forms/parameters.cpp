#include "gt3x/forms/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kEntrySize = 8;

std::uint32_t read_le(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    value |= static_cast<std::uint32_t>(bytes[at + i]) << (8 * i);
  }
  return value;
}

void append_le(Bytes& out, std::uint32_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
}

// The value, where there is one and no other.
std::optional<std::uint32_t> value_of(const Parameters& parameters, const ParameterKey& key) {
  const auto found = parameters.values.find(key);
  return found == parameters.values.end() || parameters.doubled.contains(key)
             ? std::nullopt
             : std::optional(found->second);
}

std::optional<PerAxis<int>> constants_at(const Parameters& parameters, std::uint16_t first) {
  PerAxis<int> axes{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto found =
        value_of(parameters, {kParameterUnitSpace, static_cast<std::uint16_t>(first + axis)});
    if (!found) {
      return std::nullopt;
    }
    const auto value = static_cast<std::int32_t>(*found);
    if (value < kStoredConstantMin || value > kStoredConstantMax) {
      return std::nullopt;
    }
    axes[axis] = value;
  }
  return axes;
}

}  // namespace

bool Parameters::has_zero_range() const {
  if (!constants) {
    return false;
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (constants->positive_lsb[axis] == constants->negative_lsb[axis]) {
      return true;
    }
  }
  return false;
}

bool Parameters::agrees_with(const StoredConstants& of_another) const {
  ParameterValues expected;
  set_constants(expected, of_another);
  return std::ranges::all_of(expected, [&](const auto& entry) {
    const auto own = values.find(entry.first);
    return own == values.end() || (own->second == entry.second && !doubled.contains(entry.first));
  });
}

Result<Parameters> parse_parameters(std::span<const std::uint8_t> payload) {
  if (payload.size() % kEntrySize != 0) {
    return fail(ErrorCode::bad_data,
                fmt::format("the PARAMETERS record has {} bytes, no whole number of entries",
                            payload.size()),
                {}, "the recording is damaged there; download it from the unit again");
  }
  Parameters parameters;
  for (std::size_t at = 0; at < payload.size(); at += kEntrySize) {
    const ParameterKey key(static_cast<std::uint16_t>(read_le(payload, at, 2)),
                           static_cast<std::uint16_t>(read_le(payload, at + 2, 2)));
    const std::uint32_t value = read_le(payload, at + 4, 4);
    const auto [entry, is_new] = parameters.values.try_emplace(key, value);
    if (!is_new && entry->second != value) {
      parameters.doubled.insert(key);
      entry->second = value;
    }
  }
  if (const auto time = value_of(parameters, kParameterCalibrationTime); time && *time != 0) {
    parameters.calibration_time = from_unix_seconds(*time);
  }
  if (const auto scale = value_of(parameters, kParameterAccelScale)) {
    const double decoded = decode_float(*scale);
    // A scale outside this range belongs to no accelerometer; it would turn samples to nonsense.
    if (decoded >= 1 && decoded <= 32768) {
      parameters.accel_scale_lsb_per_g = decoded;
    }
  }
  if (const auto firmware = value_of(parameters, kParameterFirmwareVersion)) {
    parameters.firmware = decode_firmware(*firmware);
  }
  const auto positive = constants_at(parameters, kParameterPositive);
  const auto negative = constants_at(parameters, kParameterNegative);
  const auto zero = constants_at(parameters, kParameterZero);
  if (positive && negative && zero) {
    parameters.constants = StoredConstants{*positive, *negative, *zero};
  }
  return parameters;
}

Bytes encode_parameters(const ParameterValues& values) {
  Bytes payload;
  payload.reserve(values.size() * kEntrySize);
  for (const auto& [key, value] : values) {
    append_le(payload, key.first, 2);
    append_le(payload, key.second, 2);
    append_le(payload, value, 4);
  }
  return payload;
}

void set_constants(ParameterValues& values, const StoredConstants& constants) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto put = [&](std::uint16_t first, int value) {
      values[{kParameterUnitSpace, static_cast<std::uint16_t>(first + axis)}] =
          static_cast<std::uint32_t>(value);
    };
    put(kParameterNegative, constants.negative_lsb[axis]);
    put(kParameterPositive, constants.positive_lsb[axis]);
    put(kParameterZero, constants.zero_lsb[axis]);
  }
}

namespace {

constexpr std::uint32_t kFractionMask = 0x00FFFFFF;
constexpr std::uint32_t kTooLarge = 0x007FFFFF;
constexpr std::uint32_t kTooLargeNegative = 0x00800000;
constexpr double kFractionUnit = 8388608.0;  // 2^23

}  // namespace

double decode_float(std::uint32_t code) {
  if (code == kTooLarge) {
    return std::numeric_limits<double>::max();
  }
  if (code == kTooLargeNegative) {
    return std::numeric_limits<double>::lowest();
  }
  const auto fraction = static_cast<std::int32_t>(code << 8) >> 8;
  const auto exponent = static_cast<std::int8_t>(code >> 24);
  return std::ldexp(static_cast<double>(fraction) / kFractionUnit, exponent);
}

std::uint32_t encode_float(double value) {
  if (!(std::abs(value) >= 1 / kFractionUnit)) {  // also for NaN
    return 0;
  }
  if (std::isinf(value)) {
    return value > 0 ? kTooLarge : kTooLargeNegative;
  }
  int exponent = 0;
  const double mantissa = std::frexp(std::abs(value), &exponent);  // in [0.5, 1)
  if (exponent > std::numeric_limits<std::int8_t>::max()) {
    return value > 0 ? kTooLarge : kTooLargeNegative;
  }
  // The vendor's encoder cuts, it does not round.
  auto fraction = static_cast<std::uint32_t>(mantissa * kFractionUnit);
  if (value < 0) {
    fraction = (~fraction + 1) & kFractionMask;
  }
  return fraction | (static_cast<std::uint32_t>(exponent) << 24);
}

std::string decode_firmware(std::uint32_t packed) {
  return fmt::format("{}.{}.{}", packed >> 24, (packed >> 16) & 0xFF, packed & 0xFFFF);
}

std::optional<std::uint32_t> encode_firmware(std::string_view version) {
  std::uint32_t packed = 0;
  const char* at = version.data();
  const char* const end = at + version.size();
  constexpr std::uint32_t kLimits[] = {0xFF, 0xFF, 0xFFFF};
  constexpr unsigned kShifts[] = {24, 16, 0};
  for (std::size_t part = 0; part < 3; ++part) {
    if (part > 0 && (at == end || *at++ != '.')) {
      return std::nullopt;
    }
    std::uint32_t number = 0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error != std::errc() || number > kLimits[part]) {
      return std::nullopt;
    }
    packed |= number << kShifts[part];
    at = next;
  }
  return at == end ? std::optional(packed) : std::nullopt;
}

}  // namespace sixpoint::gt3x
