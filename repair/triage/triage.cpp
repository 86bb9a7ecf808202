#include "repair/triage/triage.h"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>

namespace sixpoint::repair {
namespace {

using calib::FilterConfiguration;

constexpr std::array<FirmwareVersion, 5> kAffectedFirmware = {
    {{1, 4, 0}, {1, 4, 1}, {1, 5, 0}, {1, 6, 0}, {1, 7, 0}}};
constexpr FirmwareVersion kCheckRemoved = {1, 4, 0};
constexpr FirmwareVersion kCheckRestored = {1, 8, 0};
constexpr FirmwareVersion kRotatingFirmware = {1, 6, 0};

bool is_mos(const std::string& serial) { return serial.starts_with("MOS"); }

// How firmware sets the filter configuration.
enum class FilterRule { by_calibration_date, always_current, unknown };

FilterRule filter_rule(const std::optional<FirmwareVersion>& firmware) {
  if (!firmware) {
    return FilterRule::unknown;
  }
  if (std::find(kAffectedFirmware.begin(), kAffectedFirmware.end(), *firmware) !=
      kAffectedFirmware.end()) {
    return FilterRule::always_current;
  }
  if (*firmware < kCheckRemoved || *firmware >= kCheckRestored) {
    return FilterRule::by_calibration_date;
  }
  return FilterRule::unknown;  // between the two, but no version that was ever named
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  constexpr std::array<std::string_view, 3> kNames = {"affected", "not_affected", "cannot_tell"};
  return kNames[static_cast<std::size_t>(verdict)];
}

UtcTime filter_change() {
  using namespace std::chrono;
  return UtcTime(sys_days(year(2014) / March / 24));
}

std::optional<FirmwareVersion> parse_firmware(std::string_view text) {
  FirmwareVersion version;
  std::array<int*, 3> parts = {&version.major_number, &version.minor_number, &version.patch};
  const char* at = text.data();
  const char* end = text.data() + text.size();
  if (at != end && (*at == 'v' || *at == 'V')) {
    ++at;
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [next, error] = std::from_chars(at, end, *parts[i]);
    if (error != std::errc() || *parts[i] < 0) {
      return std::nullopt;
    }
    at = next;
    if (at == end) {
      // "1.5" is 1.5.0; a lone "1" is no version.
      return i == 0 ? std::nullopt : std::optional(version);
    }
    if (*at != '.') {
      return std::nullopt;
    }
    ++at;
  }
  return std::nullopt;
}

Triage triage(const FileFacts& facts) {
  Triage result;
  const auto decide = [&](Verdict verdict, std::string reason) {
    result.verdict = verdict;
    result.reasons.push_back(std::move(reason));
  };
  if (facts.serial.empty()) {
    decide(Verdict::cannot_tell, "the file does not say its unit's serial number");
    return result;
  }
  if (!is_mos(facts.serial)) {
    decide(Verdict::not_affected,
           fmt::format("serial number {}: only units whose number begins with MOS are affected",
                       printable(facts.serial, 60)));
    return result;
  }
  const auto firmware = parse_firmware(facts.firmware);
  const FilterRule rule = filter_rule(firmware);
  result.axes_rotated = firmware == kRotatingFirmware;
  const bool calibrated_late =
      facts.calibration_time.has_value() && *facts.calibration_time >= filter_change();

  if (rule == FilterRule::by_calibration_date) {
    decide(Verdict::not_affected,
           fmt::format("firmware {} chooses the filter configuration that the constants need",
                       printable(facts.firmware, 40)));
  }
  if (calibrated_late) {
    decide(Verdict::not_affected,
           fmt::format("calibrated on {}, under the configuration that all later firmware sets",
                       to_iso8601(*facts.calibration_time)));
  }
  if (result.reasons.empty()) {
    if (rule == FilterRule::always_current && facts.calibration_time.has_value()) {
      decide(Verdict::affected,
             fmt::format("calibrated on {}, before 2014-03-24, and recorded by firmware {}, which "
                         "set the other filter configuration",
                         to_iso8601(*facts.calibration_time), printable(facts.firmware, 40)));
    }
    if (!facts.calibration_time.has_value()) {
      decide(Verdict::cannot_tell, "the file does not say when the unit was calibrated");
    }
    if (facts.firmware.empty()) {
      decide(Verdict::cannot_tell, "the file does not say which firmware recorded it");
    } else if (rule == FilterRule::unknown) {
      decide(Verdict::cannot_tell, fmt::format("firmware '{}' is none whose behaviour is known",
                                               printable(facts.firmware, 40)));
    }
  }
  if (result.axes_rotated) {
    result.reasons.push_back("firmware 1.6.0 turned the axes by 90 degrees about Z");
  }
  return result;
}

std::optional<FilterConfiguration> filter_of_constants(const FileFacts& facts) {
  if (!is_mos(facts.serial) || !facts.calibration_time) {
    return std::nullopt;
  }
  return *facts.calibration_time < filter_change() ? FilterConfiguration::legacy
                                                   : FilterConfiguration::current;
}

std::optional<FilterConfiguration> filter_in_force(const FileFacts& facts) {
  if (!is_mos(facts.serial)) {
    return std::nullopt;
  }
  switch (filter_rule(parse_firmware(facts.firmware))) {
    case FilterRule::always_current:
      return FilterConfiguration::current;
    case FilterRule::by_calibration_date:
      return filter_of_constants(facts);
    case FilterRule::unknown:
      // Late units are run under `current` by every firmware.
      return filter_of_constants(facts) == FilterConfiguration::current
                 ? std::optional(FilterConfiguration::current)
                 : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace sixpoint::repair
