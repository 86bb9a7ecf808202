#include "mocks/virtual_settings.h"

#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "calib/constants.h"
#include "sim/firmware.h"

namespace sixpoint::mocks {

namespace {

tl::unexpected<Error> wrong(std::string_view key, std::string_view value, std::string_view wanted) {
  return fail(ErrorCode::usage,
              fmt::format("virtual unit: {}={} is not {}", printable(key, 40), printable(value, 60),
                          wanted),
              {}, "docs/virtual.md lists the settings of virtual units");
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(number)) {
      return std::nullopt;
    }
  }
  return number;
}

// a/b/c, each within [low, high].
template <class Number>
std::optional<PerAxis<Number>> axes_of(std::string_view text, double low, double high) {
  PerAxis<Number> axes{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const std::size_t end = axis + 1 < kAxes ? text.find('/') : text.size();
    if (end == std::string_view::npos) {
      return std::nullopt;
    }
    const auto number = number_of<Number>(text.substr(0, end));
    if (!number || !(*number >= low && *number <= high)) {
      return std::nullopt;
    }
    axes[axis] = *number;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return axes;
}

bool is_name(std::string_view text, std::size_t limit) {
  return !text.empty() && text.size() <= limit &&
         text.find_first_not_of(
             "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz-_.") ==
             std::string_view::npos;
}

}  // namespace

Result<VirtualSettings> parse_virtual_settings(std::string_view text, std::uint64_t default_seed) {
  VirtualSettings settings;
  sim::UnitWishes wishes;
  std::uint64_t seed = default_seed;
  std::set<std::string_view> seen;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const std::string_view setting = text.substr(0, comma);
    text.remove_prefix(std::min(comma + 1, text.size()));
    const std::size_t equals = setting.find('=');
    if (equals == std::string_view::npos) {
      return wrong(setting, "", "a setting of the form key=value");
    }
    const std::string_view key = setting.substr(0, equals);
    const std::string_view value = setting.substr(equals + 1);
    if (!seen.insert(key).second) {
      return wrong(key, value, "given once");
    }
    const auto lsb = [&](std::optional<PerAxis<int>>& wish) -> Status {
      wish = axes_of<int>(value, kStoredConstantMin, kStoredConstantMax);
      return wish ? Status{} : wrong(key, value, "three whole counts such as 54/47/26");
    };
    if (key == "seed") {
      const auto number = number_of<std::uint64_t>(value);
      if (!number) {
        return wrong(key, value, "a whole number that is not negative");
      }
      seed = *number;
    } else if (key == "serial") {
      if (!is_name(value, 16)) {
        return wrong(key, value, "a serial number of 1 to 16 letters and digits");
      }
      wishes.serial = std::string(value);
    } else if (key == "firmware") {
      if (!is_name(value, 12) || !sim::parse_version(value)) {
        return wrong(key, value, "a version such as 1.5.0");
      }
      wishes.firmware = std::string(value);
    } else if (key == "calibrated") {
      const auto time = parse_iso8601(value);
      if (!time || *time < *parse_iso8601("2000-01-01") || *time >= *parse_iso8601("2106-01-01")) {
        return wrong(key, value, "a date such as 2013-11-12");
      }
      wishes.calibrated = std::chrono::floor<std::chrono::seconds>(*time);
    } else if (key == "positive_lsb") {
      SIXPOINT_CHECK(lsb(wishes.positive_lsb));
    } else if (key == "negative_lsb") {
      SIXPOINT_CHECK(lsb(wishes.negative_lsb));
    } else if (key == "zero_lsb") {
      SIXPOINT_CHECK(lsb(wishes.zero_lsb));
    } else if (key == "true_sensitivity_lsb_per_g") {
      wishes.current_sensitivity_lsb_per_g = axes_of<double>(value, 1, 2047);
      if (!wishes.current_sensitivity_lsb_per_g) {
        return wrong(key, value, "three sensitivities such as 237.7/251.8/242.3");
      }
    } else if (key == "true_zero_lsb") {
      wishes.current_zero_lsb = axes_of<double>(value, -2048, 2047);
      if (!wishes.current_zero_lsb) {
        return wrong(key, value, "three readings such as 49.9/95.8/60.8");
      }
    } else if (key == "jig") {
      if (value != "auto" && value != "none") {
        return wrong(key, value, "auto or none");
      }
      settings.with_jig = value == "auto";
    } else if (key == "pace") {
      const auto factor = number_of<int>(value);
      if (value != "fast" && value != "real" && !(factor && *factor >= 2 && *factor <= 100)) {
        return wrong(key, value, "fast, real or 2 to 100");
      }
      settings.real_time = value != "fast";
      settings.pace = factor.value_or(1);
    } else if (key == "interfaces") {
      if (value != "all" && value != "storage") {
        return wrong(key, value, "all or storage");
      }
      settings.storage_only = value == "storage";
    } else if (key == "battery_mv") {
      const auto number = number_of<std::uint16_t>(value);
      if (!number) {
        return wrong(key, value, "a voltage such as 4100");
      }
      settings.unit.battery_mv = *number;
    } else if (key == "temperature_c") {
      const auto number = number_of<double>(value);
      if (!number || std::abs(*number) > 200) {
        return wrong(key, value, "a temperature such as 24.5");
      }
      settings.unit.temperature_c = *number;
    } else if (key == "faults") {
      if (value.empty()) {
        return wrong(key, value, "the file of a fault plan (docs/faults.md)");
      }
      settings.faults_file = std::string(value);
    } else {
      return wrong(key, value, "a setting of virtual units");
    }
  }
  settings.unit.seed = seed;
  settings.unit.truth = sim::draw_unit(seed, wishes);
  if (const Status valid = calib::validate(settings.unit.truth.constants); !valid) {
    return wrong("positive_lsb and negative_lsb", "...", "a pair with positive above negative");
  }
  return settings;
}

Result<VirtualSettings> parse_openable_settings(std::string_view text, std::uint64_t default_seed) {
  SIXPOINT_ASSIGN(VirtualSettings settings, parse_virtual_settings(text, default_seed));
  if (settings.storage_only) {
    return fail(ErrorCode::usage, "a unit with mass storage alone cannot be talked to",
                fmt::format("virtual:{}", printable(text, 80)),
                "offer it with 'sixpoint virtual --device', mount it, and use drive:FOLDER");
  }
  return settings;
}

}  // namespace sixpoint::mocks
