// info.txt: what the vendor's software wrote down about the recording, "Key: value" line by line.
//
//   SIXPOINT_ASSIGN(Info info, Info::parse("Serial Number: MOS2A45130450\r\nSample Rate: 30\r\n"));
//   info.serial();          // "MOS2A45130450"
//   info.sample_rate_hz();  // 30
//   info.set("Subject Name", "007");
//   const std::string text = info.serialise();
//
// Read with tolerance (a byte-order mark, either line end, decimal commas, lines that are no pairs)
// and written back exactly as it was, but for the lines that were set.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/time.h"

namespace sixpoint::gt3x {

class Info {
 public:
  // An empty one, for recordings that are made here; lines end in CR LF, as the vendor's do.
  Info() = default;

  // bad_data for text that holds no "Key: value" line at all, for UTF-16, and above 1 MiB.
  static Result<Info> parse(std::string_view text);
  std::string serialise() const;

  // The value of the first line with this key, without blanks around it; keys are compared exactly.
  std::optional<std::string_view> get(std::string_view key) const;
  // The value of the first line with this key that says something else than the first one.
  std::optional<std::string_view> other(std::string_view key) const;
  // Every "Key: value" line, in order.
  std::vector<std::pair<std::string, std::string>> pairs() const;
  // Changes the first line with this key, or adds one at the end. Line ends inside the value become
  // blanks.
  void set(std::string_view key, std::string_view value);

  std::string serial() const { return text_of("Serial Number"); }
  std::string device_type() const { return text_of("Device Type"); }
  std::string firmware() const { return text_of("Firmware"); }
  std::string subject() const { return text_of("Subject Name"); }

  // Nothing where the line is missing or says something that cannot be; 0 Hz is passed on.
  std::optional<double> sample_rate_hz() const;
  std::optional<double> accel_scale_lsb_per_g() const;
  std::optional<double> accel_min_g() const { return number_of("Acceleration Min"); }
  std::optional<double> accel_max_g() const { return number_of("Acceleration Max"); }
  std::optional<double> battery_v() const { return number_of("Battery Voltage"); }

  // Times as the unit's clock showed them (local time written as UTC, like the records'); nothing
  // where the value is 0 or lies outside what Unix time in 32 bits can say.
  std::optional<UtcTime> start() const { return time_of("Start Date"); }
  std::optional<UtcTime> stop() const { return time_of("Stop Date"); }
  std::optional<UtcTime> last_sample() const { return time_of("Last Sample Time"); }
  std::optional<UtcTime> download() const { return time_of("Download Date"); }

  std::optional<double> number_of(std::string_view key) const;
  std::optional<UtcTime> time_of(std::string_view key) const;

 private:
  struct Line {
    std::string key;    // empty where the line is no pair
    std::string value;  // without blanks around it
    std::string text;   // the whole line with its end
  };
  std::string text_of(std::string_view key) const;

  bool byte_order_mark_ = false;
  std::vector<Line> lines_;
};

// .NET ticks: units of 100 ns since 0001-01-01. nullopt outside 1970 .. 2106.
std::optional<UtcTime> from_ticks(std::int64_t ticks);
std::int64_t to_ticks(UtcTime time);

// A number with a point or a comma before its decimals; nullopt for anything else, and for what is
// not finite.
std::optional<double> parse_decimal(std::string_view text);

}  // namespace sixpoint::gt3x
