#include "gt3x/forms/clock.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <initializer_list>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/bytes.h"

namespace sixpoint::gt3x {
namespace {

using Json = nlohmann::json;

constexpr int kFarthest_minutes = 14 * 60;

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

// Without regard to capitals and blanks: "Centre Point", "CentrePoint 3".
bool names(std::string_view text, std::string_view software) {
  std::string plain;
  for (const char c : text) {
    if (c >= 'A' && c <= 'Z') {
      plain += static_cast<char>(c - 'A' + 'a');
    } else if (c != ' ') {
      plain += c;
    }
  }
  return plain.find(software) != std::string::npos;
}

std::optional<int> first_of(std::initializer_list<std::optional<int>> offsets) {
  for (const auto& offset : offsets) {
    if (offset) {
      return offset;
    }
  }
  return std::nullopt;
}

std::string offset_text(int minutes) {
  return fmt::format("{}{:02}:{:02}", minutes < 0 ? '-' : '+', std::abs(minutes) / 60,
                     std::abs(minutes) % 60);
}

}  // namespace

std::string_view to_string(ClockKind kind) {
  constexpr std::array<std::string_view, 3> kNames = {"local", "utc", "unknown"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::optional<int> parse_offset(std::string_view text) {
  const bool minus = text.starts_with('-');
  if (minus || text.starts_with('+')) {
    text.remove_prefix(1);
  }
  std::array<int, 3> parts{};  // hours, minutes, seconds
  std::size_t count = 0;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (; count < parts.size() && at != end; ++count) {
    if (count > 0 && *at++ != ':') {
      return std::nullopt;
    }
    const auto [next, error] = std::from_chars(at, end, parts[count]);
    if (error != std::errc() || parts[count] < 0 || parts[count] >= 60) {
      return std::nullopt;
    }
    at = next;
  }
  const int minutes = parts[0] * 60 + parts[1];
  if (at != end || count < 2 || minutes > kFarthest_minutes) {
    return std::nullopt;
  }
  return minus ? -minutes : minutes;
}

void ClockEvidence::take_info(const Info& info) {
  if (const auto zone = info.get("TimeZone")) {
    header_offset_minutes = parse_offset(*zone);
  }
  for (const char* key : {"Download Software", "Software", "Software Name"}) {
    if (const auto value = info.get(key); value && software.empty()) {
      software = std::string(*value);
    }
  }
}

void ClockEvidence::take_metadata(std::span<const std::uint8_t> payload) {
  const Json::parser_callback_t shallow = [](int depth, Json::parse_event_t, Json&) {
    return depth < 3;
  };
  const Json json = Json::parse(payload.begin(), payload.end(), shallow, false);
  if (!json.is_object()) {
    return;
  }
  const std::string type = text_at(json, "MetadataType");
  if (type == "LocalTimeLog") {
    local_time_log = true;
    log_offset_minutes = parse_offset(text_at(json, "UtcOffset"));
    if (const auto utc = json.find("UsedUtc"); utc != json.end() && utc->is_boolean()) {
      used_utc = utc->get<bool>();
    }
  } else if (type == "SubjectTimeLog") {
    subject_offset_minutes = parse_offset(text_at(json, "UtcOffset"));
  } else if (type == "InitOwner") {
    if (std::string system = text_at(json, "System"); !system.empty()) {
      software = std::move(system);
    }
  }
}

Clock which_clock(const ClockEvidence& evidence) {
  const auto utc = [&](std::string why) {
    return Clock{ClockKind::utc,
                 first_of({evidence.subject_offset_minutes, evidence.log_offset_minutes,
                           evidence.header_offset_minutes, evidence.unit_offset_minutes}),
                 std::move(why)};
  };
  const auto local = [&](std::string why) {
    return Clock{ClockKind::local,
                 first_of({evidence.log_offset_minutes, evidence.header_offset_minutes}),
                 std::move(why)};
  };
  const std::string software = printable(evidence.software, 40);
  if (evidence.used_utc) {
    return *evidence.used_utc
               ? utc("the METADATA record LocalTimeLog says that UTC was used")
               : local("the METADATA record LocalTimeLog says that UTC was not used");
  }
  if (names(evidence.software, "centrepoint") || names(evidence.software, "studyadmin")) {
    return utc(fmt::format("{} set the unit's clock, which it does to UTC", software));
  }
  if (names(evidence.software, "actilife")) {
    return local(fmt::format("{} set the unit's clock, which it does to local time", software));
  }
  if (evidence.local_time_log) {
    return local("there is a METADATA record LocalTimeLog, and it does not say that UTC was used");
  }
  if (evidence.raw_counts) {
    return utc("the recording is an .agdc, which CentrePoint writes, and it uses UTC");
  }
  if (evidence.old_form) {
    return local("units of the old form have the clock of the computer that set them");
  }
  if (evidence.unit_offset_minutes) {
    return utc("PARAMETERS name an offset from UTC");
  }
  return {ClockKind::unknown, std::nullopt,
          "no METADATA record and no line of info.txt says who set the unit's clock"};
}

std::string clock_time(const Clock& clock, std::int64_t unix_s) {
  return clock_time(clock, from_unix_seconds(unix_s));
}

std::string clock_time(const Clock& clock, UtcTime time) {
  const bool shifted = clock.kind == ClockKind::utc && clock.offset_minutes;
  std::string text = to_iso8601(time + std::chrono::minutes(shifted ? *clock.offset_minutes : 0));
  if (clock.kind == ClockKind::utc && !clock.offset_minutes) {
    return text;
  }
  text.pop_back();  // Z
  return clock.kind != ClockKind::unknown && clock.offset_minutes
             ? text + offset_text(*clock.offset_minutes)
             : text;
}

}  // namespace sixpoint::gt3x
