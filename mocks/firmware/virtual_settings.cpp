#include "mocks/firmware/virtual_settings.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "calib/constants.h"
#include "sim/firmware.h"

namespace sixpoint::mocks {

namespace {

constexpr const char* kWhereSettingsAre = "docs/virtual.md lists the settings of virtual units";

tl::unexpected<Error> wrong(std::string_view key, std::string_view value, std::string_view wanted) {
  return fail(ErrorCode::usage,
              fmt::format("virtual unit: {}={} is not {}", printable(key, 40), printable(value, 60),
                          wanted),
              {}, kWhereSettingsAre);
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

// What has been read so far.
struct Draft {
  VirtualSettings settings;
  sim::GivenProperties given;
  std::uint64_t seed = 0;
  std::optional<std::uint64_t> noise;
};

bool read_lsb(std::string_view value, std::optional<PerAxis<int>>& wish) {
  wish = axes_of<int>(value, kStoredConstantMin, kStoredConstantMax);
  return wish.has_value();
}

template <class Number>
bool read_number(std::string_view value, Number low, Number high, Number& number) {
  const auto found = number_of<Number>(value);
  number = found.value_or(number);
  return found && *found >= low && *found <= high;
}

bool read_date(std::string_view value, std::optional<UtcTime>& date) {
  const auto time = parse_iso8601(value);
  if (!time || *time < *parse_iso8601("2000-01-01") || *time >= *parse_iso8601("2106-01-01")) {
    return false;
  }
  date = std::chrono::floor<std::chrono::seconds>(*time);
  return true;
}

bool read_pace(std::string_view value, VirtualSettings& settings) {
  settings.real_time = value != "fast";
  return value == "fast" || value == "real" || read_number(value, 2, 100, settings.pace);
}

bool read_switch(std::string_view value, std::string_view on, std::string_view off, bool& setting) {
  setting = value == on;
  return value == on || value == off;
}

// A unit that must fail, with the code of its name (docs/verdicts.md): well beyond the built-in
// limits in one quantity, and within them in all others.
bool read_defect(std::string_view value, sim::GivenProperties& given) {
  given.current_sensitivity_lsb_per_g = PerAxis<double>{250, 250, 250};
  given.current_zero_lsb = PerAxis<double>{20, 20, 20};
  if (value == "zero_high" || value == "zero_low") {
    (*given.current_zero_lsb)[0] = value == "zero_high" ? 225 : -200;
    return true;
  }
  if (value == "sensitivity_low" || value == "sensitivity_high") {
    (*given.current_sensitivity_lsb_per_g)[0] = value == "sensitivity_low" ? 350 : 150;
    return true;
  }
  return false;
}

struct Setting {
  std::string_view key;
  bool (*read)(std::string_view value, Draft& draft);  // false: refused
  std::string_view wanted;                             // what the value must be
};

constexpr std::string_view kThreeCounts = "three whole counts such as 54/47/26";

bool read_rotation(std::string_view value, PerAxis<double>& vector_deg) {
  const auto read = axes_of<double>(value, -10, 10);
  vector_deg = read.value_or(vector_deg);
  return read.has_value();
}

constexpr std::string_view kRotation = "a rotation vector of -10 to 10 degrees such as 0.1/-0.2/0";

constexpr std::array<Setting, 19> kSettings = {{
    {"bad", [](auto value, auto& d) { return read_defect(value, d.given); },
     "zero_high, zero_low, sensitivity_low or sensitivity_high"},
    {"seed",
     [](auto value, auto& d) { return read_number(value, std::uint64_t{0}, UINT64_MAX, d.seed); },
     "a whole number that is not negative"},
    {"noise",
     [](auto value, auto& d) {
       return read_number(value, std::uint64_t{0}, UINT64_MAX, d.noise.emplace());
     },
     "a whole number that is not negative"},
    {"serial",
     [](auto value, auto& d) {
       d.given.serial = std::string(value);
       return is_name(value, 16);
     },
     "a serial number of 1 to 16 letters and digits"},
    {"firmware",
     [](auto value, auto& d) {
       d.given.firmware = std::string(value);
       return is_name(value, 12) && sim::parse_version(value).has_value();
     },
     "a version such as 1.5.0"},
    {"calibrated", [](auto value, auto& d) { return read_date(value, d.given.calibrated); },
     "a date such as 2013-11-12"},
    {"positive_lsb", [](auto value, auto& d) { return read_lsb(value, d.given.positive_lsb); },
     kThreeCounts},
    {"negative_lsb", [](auto value, auto& d) { return read_lsb(value, d.given.negative_lsb); },
     kThreeCounts},
    {"zero_lsb", [](auto value, auto& d) { return read_lsb(value, d.given.zero_lsb); },
     kThreeCounts},
    {"true_sensitivity_lsb_per_g",
     [](auto value, auto& d) {
       d.given.current_sensitivity_lsb_per_g = axes_of<double>(value, 1, 2047);
       return d.given.current_sensitivity_lsb_per_g.has_value();
     },
     "three sensitivities such as 237.7/251.8/242.3"},
    {"true_zero_lsb",
     [](auto value, auto& d) {
       d.given.current_zero_lsb = axes_of<double>(value, -2048, 2047);
       return d.given.current_zero_lsb.has_value();
     },
     "three readings such as 49.9/95.8/60.8"},
    {"jig",
     [](auto value, auto& d) { return read_switch(value, "auto", "none", d.settings.with_jig); },
     "auto or none"},
    {"pace", [](auto value, auto& d) { return read_pace(value, d.settings); },
     "fast, real or 2 to 100"},
    {"interfaces",
     [](auto value, auto& d) {
       return read_switch(value, "storage", "all", d.settings.storage_only);
     },
     "all or storage"},
    {"battery_mv",
     [](auto value, auto& d) {
       return read_number(value, std::uint16_t{0}, std::uint16_t{65535},
                          d.settings.unit.battery_mv);
     },
     "a voltage such as 4100"},
    {"temperature_c",
     [](auto value, auto& d) {
       return read_number(value, -200.0, 200.0, d.settings.unit.temperature_c);
     },
     "a temperature such as 24.5"},
    {"jig_tilt_deg",
     [](auto value, auto& d) { return read_rotation(value, d.settings.unit.jig_tilt_deg); },
     kRotation},
    {"misalignment_deg",
     [](auto value, auto& d) { return read_rotation(value, d.settings.unit.misalignment_deg); },
     kRotation},
    {"faults",
     [](auto value, auto& d) {
       d.settings.faults_file = std::string(value);
       return !value.empty();
     },
     "the file of a fault plan (docs/faults.md)"},
}};

Status read_setting(std::string_view setting, std::set<std::string_view>& seen, Draft& draft) {
  const std::size_t equals = setting.find('=');
  if (equals == std::string_view::npos) {
    return fail(ErrorCode::usage,
                fmt::format("virtual unit: {} is not a setting of the form key=value",
                            printable(setting, 40)),
                {}, kWhereSettingsAre);
  }
  const std::string_view key = setting.substr(0, equals);
  const std::string_view value = setting.substr(equals + 1);
  if (!seen.insert(key).second) {
    return fail(ErrorCode::usage,
                fmt::format("virtual unit: {} is given twice", printable(key, 40)), {},
                "give it once");
  }
  const auto known = std::find_if(kSettings.begin(), kSettings.end(),
                                  [key](const Setting& entry) { return entry.key == key; });
  if (known == kSettings.end()) {
    return wrong(key, value, "a setting of virtual units");
  }
  return known->read(value, draft) ? Status{} : wrong(key, value, known->wanted);
}

}  // namespace

Result<VirtualSettings> parse_virtual_settings(std::string_view text, std::uint64_t default_seed) {
  Draft draft;
  draft.seed = default_seed;
  std::set<std::string_view> seen;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    SIXPOINT_CHECK(read_setting(text.substr(0, comma), seen, draft));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  draft.settings.unit.seed = draft.noise.value_or(draft.seed);
  draft.settings.unit.truth = sim::draw_unit(draft.seed, draft.given);
  if (!calib::validate(draft.settings.unit.truth.constants)) {
    return wrong("positive_lsb and negative_lsb", "...", "a pair with positive above negative");
  }
  return draft.settings;
}

Result<VirtualSettings> parse_openable_settings(std::string_view text, std::uint64_t default_seed) {
  SIXPOINT_ASSIGN(VirtualSettings settings, parse_virtual_settings(text, default_seed));
  if (settings.storage_only) {
    return fail(ErrorCode::usage, "a unit with mass storage alone takes no commands",
                fmt::format("virtual:{}", printable(text, 80)),
                "offer it with 'sixpoint virtual --device', mount it, and use drive:FOLDER");
  }
  return settings;
}

}  // namespace sixpoint::mocks
