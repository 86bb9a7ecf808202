#include "gt3x/forms/info.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::gt3x {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::size_t kMaxSize = 1 << 20;
constexpr std::int64_t kTicksAt1970 = 621'355'968'000'000'000;
constexpr std::int64_t kTicksPerSecond = 10'000'000;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank(" \t\r\n\0", 5);
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) {
    return {};
  }
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

}  // namespace

std::optional<UtcTime> from_ticks(std::int64_t ticks) {
  constexpr std::int64_t kEnd = kTicksAt1970 + (std::int64_t{1} << 32) * kTicksPerSecond;
  if (ticks < kTicksAt1970 || ticks >= kEnd) {
    return std::nullopt;
  }
  return UtcTime(std::chrono::nanoseconds((ticks - kTicksAt1970) * 100));
}

std::int64_t to_ticks(UtcTime time) {
  return kTicksAt1970 +
         std::chrono::floor<std::chrono::nanoseconds>(time.time_since_epoch()).count() / 100;
}

std::optional<double> parse_decimal(std::string_view text) {
  std::string point(trimmed(text));
  std::ranges::replace(point, ',', '.');
  double value = 0;
  const char* const end = point.data() + point.size();
  const auto [next, error] = std::from_chars(point.data(), end, value);
  if (error != std::errc() || next != end || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

Result<Info> Info::parse(std::string_view text) {
  if (text.size() > kMaxSize) {
    return fail(ErrorCode::bad_data,
                fmt::format("info.txt has {} bytes, more than it can need", text.size()), {},
                "check that this is a recording; download it from the unit again");
  }
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    return fail(ErrorCode::bad_data, "info.txt is UTF-16, and the vendor's is UTF-8", {},
                "another program has changed it; download the recording from the unit again");
  }
  Info info;
  if (text.starts_with(kByteOrderMark)) {
    info.byte_order_mark_ = true;
    text.remove_prefix(kByteOrderMark.size());
  }
  bool any = false;
  while (!text.empty()) {
    const auto end = text.find('\n');
    const std::string_view whole = text.substr(0, end == std::string_view::npos ? end : end + 1);
    text.remove_prefix(whole.size());
    Line line;
    line.text = whole;
    if (const auto colon = whole.find(':'); colon != std::string_view::npos) {
      line.key = trimmed(whole.substr(0, colon));
      line.value = trimmed(whole.substr(colon + 1));
      any = any || !line.key.empty();
    }
    info.lines_.push_back(std::move(line));
  }
  if (!any) {
    return fail(ErrorCode::bad_data, "info.txt holds no 'Key: value' line", {},
                "check that this is a recording; download it from the unit again");
  }
  return info;
}

std::string Info::serialise() const {
  std::string text(byte_order_mark_ ? kByteOrderMark : std::string_view());
  for (const Line& line : lines_) {
    text += line.text;
  }
  return text;
}

std::vector<std::pair<std::string, std::string>> Info::pairs() const {
  std::vector<std::pair<std::string, std::string>> pairs;
  for (const Line& line : lines_) {
    if (!line.key.empty()) {
      pairs.emplace_back(line.key, line.value);
    }
  }
  return pairs;
}

std::optional<std::string_view> Info::get(std::string_view key) const {
  const auto found = std::ranges::find(lines_, key, &Line::key);
  if (key.empty() || found == lines_.end()) {
    return std::nullopt;
  }
  return found->value;
}

std::optional<std::string_view> Info::other(std::string_view key) const {
  const std::optional<std::string_view> first = get(key);
  const auto found = std::ranges::find_if(
      lines_, [&](const Line& line) { return line.key == key && line.value != first; });
  return first && found != lines_.end() ? std::optional<std::string_view>(found->value)
                                        : std::nullopt;
}

void Info::set(std::string_view key, std::string_view value) {
  std::string clean(value);
  std::ranges::replace_if(
      clean, [](char c) { return c == '\n' || c == '\r'; }, ' ');
  Line line{std::string(key), std::string(trimmed(clean)), {}};
  line.text = fmt::format("{}: {}\r\n", line.key, line.value);
  const auto found = std::ranges::find(lines_, key, &Line::key);
  if (found != lines_.end()) {
    *found = std::move(line);
    return;
  }
  if (!lines_.empty() && !lines_.back().text.ends_with('\n')) {
    lines_.back().text += "\r\n";
  }
  lines_.push_back(std::move(line));
}

std::string Info::text_of(std::string_view key) const {
  return std::string(get(key).value_or(std::string_view()));
}

std::optional<double> Info::number_of(std::string_view key) const {
  const auto value = get(key);
  return value ? parse_decimal(*value) : std::nullopt;
}

std::optional<double> Info::sample_rate_hz() const {
  const auto rate = number_of("Sample Rate");
  return rate && *rate >= 0 && *rate <= 10'000 ? rate : std::nullopt;
}

std::optional<double> Info::accel_scale_lsb_per_g() const {
  const auto scale = number_of("Acceleration Scale");
  return scale && *scale > 0 && *scale <= 32768 ? scale : std::nullopt;
}

std::optional<UtcTime> Info::time_of(std::string_view key) const {
  const auto value = get(key);
  if (!value) {
    return std::nullopt;
  }
  std::int64_t ticks = 0;
  const char* const end = value->data() + value->size();
  const auto [next, error] = std::from_chars(value->data(), end, ticks);
  if (error != std::errc() || next != end) {
    return std::nullopt;
  }
  return from_ticks(ticks);
}

}  // namespace sixpoint::gt3x
