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

// In capitals or not: files with either are known.
bool is_mos(std::string_view serial) {
  constexpr std::string_view kPrefix = "MOS";
  return serial.size() >= kPrefix.size() &&
         std::equal(kPrefix.begin(), kPrefix.end(), serial.begin(),
                    [](char a, char b) { return a == b || b == a - 'A' + 'a'; });
}

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

UtcTime first_possible_calibration() {
  using namespace std::chrono;
  return UtcTime(sys_days(year(2012) / January / 1));
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

namespace {

bool is_behind_recording(const FileFacts& facts) {
  return facts.recorded && *facts.recorded >= first_possible_calibration() &&
         *facts.calibration_time > *facts.recorded + std::chrono::hours(24);
}

}  // namespace

std::optional<UtcTime> date_of_constants(const FileFacts& facts) {
  return facts.calibration_time && *facts.calibration_time >= first_possible_calibration() &&
                 !is_behind_recording(facts)
             ? facts.calibration_time
             : std::nullopt;
}

namespace {

// A MOS unit's file by one of its readings: the first firmware and date of `facts` count.
Triage triage_by(const FileFacts& facts) {
  const std::string& version = facts.firmware;
  Triage result;
  const auto decide = [&](Verdict verdict, std::string reason) {
    result.verdict = verdict;
    result.reasons.push_back(std::move(reason));
  };
  const auto firmware = parse_firmware(version);
  const FilterRule rule = filter_rule(firmware);
  const auto calibrated = date_of_constants(facts);
  result.axes_rotated = firmware == kRotatingFirmware;

  if (rule == FilterRule::by_calibration_date) {
    decide(Verdict::not_affected,
           fmt::format("firmware {} chooses the filter configuration that the constants need",
                       printable(version, 40)));
  }
  if (calibrated && *calibrated >= filter_change()) {
    decide(Verdict::not_affected,
           fmt::format("calibrated on {}, under the configuration that all later firmware sets",
                       to_iso8601(*calibrated)));
  }
  if (result.reasons.empty()) {
    if (rule == FilterRule::always_current && calibrated) {
      decide(Verdict::affected,
             fmt::format("calibrated on {}, before 2014-03-24, and recorded by firmware {}, which "
                         "set the other filter configuration",
                         to_iso8601(*calibrated), printable(version, 40)));
    }
    if (!facts.calibration_time.has_value()) {
      decide(Verdict::cannot_tell, "the file does not say when the unit was calibrated");
    } else if (!calibrated) {
      decide(Verdict::cannot_tell,
             fmt::format("the file says that the unit was calibrated on {}, {}",
                         to_iso8601(*facts.calibration_time),
                         is_behind_recording(facts)
                             ? "after it was recorded: a clock was wrong"
                             : "before such units were made: a clock had not been set"));
    }
    if (version.empty()) {
      decide(Verdict::cannot_tell, "the file does not say which firmware recorded it");
    } else if (rule == FilterRule::unknown) {
      decide(Verdict::cannot_tell,
             fmt::format("firmware '{}' is none whose behaviour is known", printable(version, 40)));
    }
  }
  if (result.axes_rotated) {
    result.reasons.push_back("firmware 1.6.0 turned the axes by 90 degrees about Z");
  }
  return result;
}

// The facts with each of the firmware versions, and each of the dates, that they name.
std::vector<FileFacts> readings_of(const FileFacts& facts) {
  std::vector<FileFacts> readings = {facts};
  if (!facts.other_firmware.empty()) {
    readings.push_back(facts);
    readings.back().firmware = facts.other_firmware;
  }
  if (facts.other_calibration_time) {
    for (std::size_t i = readings.size(); i-- > 0;) {
      readings.push_back(readings[i]);
      readings.back().calibration_time = facts.other_calibration_time;
    }
  }
  return readings;
}

}  // namespace

Triage triage(const FileFacts& facts) {
  if (facts.serial.empty()) {
    return {Verdict::cannot_tell, {"the file does not say its unit's serial number"}};
  }
  if (!facts.other_serial.empty()) {
    return {Verdict::cannot_tell,
            {fmt::format("info.txt names two units, {} and {}", printable(facts.serial, 60),
                         printable(facts.other_serial, 60))}};
  }
  if (!is_mos(facts.serial)) {
    return {Verdict::not_affected,
            {fmt::format("serial number {}: only units whose number begins with MOS are affected",
                         printable(facts.serial, 60))}};
  }
  std::vector<FileFacts> readings = readings_of(facts);
  Triage result = triage_by(readings.front());
  const bool one_answer = std::ranges::all_of(readings, [&](const FileFacts& reading) {
    const Triage other = triage_by(reading);
    return other.verdict == result.verdict && other.axes_rotated == result.axes_rotated;
  });
  if (!one_answer) {
    result = {};
  }
  if (!facts.other_firmware.empty()) {
    result.reasons.push_back(fmt::format("the file names two firmware versions, {} and {}",
                                         printable(facts.firmware, 40),
                                         printable(facts.other_firmware, 40)));
  }
  if (facts.calibration_time && facts.other_calibration_time) {
    result.reasons.push_back(fmt::format("the recording gives two dates of calibration, {} and {}",
                                         to_iso8601(*facts.calibration_time),
                                         to_iso8601(*facts.other_calibration_time)));
  }
  if (!one_answer) {
    result.reasons.back() += ": they lead to different answers, and one of them is wrong";
  }
  return result;
}

namespace {

std::optional<FilterConfiguration> filter_of_constants_by(const FileFacts& reading) {
  const auto calibrated = date_of_constants(reading);
  if (!calibrated) {
    return std::nullopt;
  }
  return *calibrated < filter_change() ? FilterConfiguration::legacy : FilterConfiguration::current;
}

std::optional<FilterConfiguration> filter_set_by(const FileFacts& reading) {
  const auto of_constants = filter_of_constants_by(reading);
  switch (filter_rule(parse_firmware(reading.firmware))) {
    case FilterRule::always_current:
      return FilterConfiguration::current;
    case FilterRule::by_calibration_date:
      return of_constants;
    case FilterRule::unknown:
      // Late units are run under `current` by every firmware.
      return of_constants == FilterConfiguration::current ? of_constants : std::nullopt;
  }
  return std::nullopt;
}

// What all readings of the facts say.
template <class Answer>
std::optional<FilterConfiguration> agreed(const FileFacts& facts, Answer answer) {
  if (!is_mos(facts.serial)) {
    return std::nullopt;
  }
  const std::vector<FileFacts> readings = readings_of(facts);
  const auto first = answer(readings.front());
  return std::ranges::all_of(readings,
                             [&](const FileFacts& reading) { return answer(reading) == first; })
             ? first
             : std::nullopt;
}

}  // namespace

std::optional<FilterConfiguration> filter_of_constants(const FileFacts& facts) {
  return agreed(facts, filter_of_constants_by);
}

std::optional<FilterConfiguration> filter_in_force(const FileFacts& facts) {
  return agreed(facts, filter_set_by);
}

}  // namespace sixpoint::repair
