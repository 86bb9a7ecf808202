#include "gt3x/rows/records_csv.h"

#include <fmt/format.h>

#include "gt3x/forms/clock.h"
#include "gt3x/forms/eeprom.h"
#include "gt3x/forms/small_records.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gt3x {
namespace {

// As it is known at the first sample (of the old form by the header), where `export --time` asks for
// it too.
Result<bool> is_by_utc(Recording& recording) {
  SampleReader reader(recording);
  if (recording.has_log()) {
    SIXPOINT_CHECK(reader.next());
  }
  return reader.clock().kind == ClockKind::utc;
}

// The rows of one record as lines.
std::string lines_of(std::int64_t unix_s, bool utc,
                     const std::vector<std::vector<std::string>>& rows) {
  std::string time = to_iso8601(from_unix_seconds(unix_s));
  if (!utc) {
    time.pop_back();  // Z
  }
  std::string text;
  for (const auto& row : rows) {
    text += fmt::format("{},{}", time, unix_s);
    for (const std::string& value : row) {
      text.append(",").append(value);
    }
    text += "\n";
  }
  return text;
}

Result<std::optional<TemperatureCalibration>> temperature_calibration(Recording& recording) {
  constexpr const char* kEntry = "temperature_calibration.json";
  if (!recording.has_entry(kEntry)) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const auto source, recording.open_entry(kEntry));
  SIXPOINT_ASSIGN(const Bytes bytes, read_all(*source, 1U << 20));
  SIXPOINT_ASSIGN(const auto calibration, parse_temperature_calibration(as_text(bytes)));
  return calibration;
}

Result<RecordsCsvTally> write_old_lux(Recording& recording, bool utc, const TextSink& sink) {
  const auto start = recording.info().start();
  if (!start) {
    return fail(ErrorCode::bad_data, "info.txt names no start", recording.path(),
                "download the recording from the unit again");
  }
  const std::string serial = recording.info().serial();
  SIXPOINT_CHECK(sink(old_lux(serial, 0) ? "time,unix_s,lux\n" : "time,unix_s,lux_raw\n"));
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("lux.bin"));
  RecordsCsvTally tally;
  Bytes bytes(std::size_t{64} * 1024);
  std::size_t held = 0;
  for (;;) {
    SIXPOINT_ASSIGN(const std::size_t count, source->read(std::span(bytes).subspan(held)));
    held += count;
    std::string text;
    std::size_t used = 0;
    for (; used + 2 <= held; used += 2) {
      const int reading = bytes[used] | (bytes[used + 1] << 8);
      const std::string value = fmt::format("{}", old_lux(serial, reading).value_or(reading));
      text += lines_of(to_unix_seconds(*start) + static_cast<std::int64_t>(tally.records), utc,
                       {{value}});
      ++tally.records;
    }
    SIXPOINT_CHECK(sink(text));
    if (count == 0) {
      tally.unreadable_records = held - used;
      return tally;
    }
    if (used < held) {
      bytes[0] = bytes[used];
    }
    held -= used;
  }
}

Result<RecordsCsvTally> write_old_battery(Recording& recording, bool utc, const TextSink& sink) {
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("battery.bin"));
  SIXPOINT_ASSIGN(const Bytes bytes, read_all(*source, 1U << 24));
  RecordsCsvTally tally;
  for (const OldBatteryReading& reading : parse_old_battery(bytes)) {
    SIXPOINT_CHECK(sink(
        lines_of(to_unix_seconds(reading.time), utc, {{fmt::format("{}", reading.battery_v)}})));
    ++tally.records;
  }
  tally.unreadable_records = bytes.size() / kOldBatteryEntry - tally.records;
  return tally;
}

}  // namespace

Result<RecordsCsvTally> write_records_csv(Recording& recording, std::uint8_t type,
                                          const TextSink& sink) {
  SIXPOINT_ASSIGN(const bool utc, is_by_utc(recording));
  std::string header = "time,unix_s";
  for (const std::string& column : small_record_columns(type)) {
    header += "," + column;
  }
  if (!recording.has_log() && type == static_cast<std::uint8_t>(RecordType::battery) &&
      recording.has_entry("battery.bin")) {
    SIXPOINT_CHECK(sink(header + "\n"));
    return write_old_battery(recording, utc, sink);
  }
  const bool has_old_lux = !recording.has_log() &&
                           type == static_cast<std::uint8_t>(RecordType::lux) &&
                           recording.has_entry("lux.bin");
  if (has_old_lux) {
    return write_old_lux(recording, utc, sink);
  }
  SIXPOINT_ASSIGN(LogReader log, recording.open_log());
  SIXPOINT_ASSIGN(const auto temperature, temperature_calibration(recording));
  SIXPOINT_CHECK(sink(header + "\n"));
  RecordsCsvTally tally;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      return tally;
    }
    if (item->kind != LogItem::Kind::record || item->record.type != type) {
      continue;
    }
    const Record& record = item->record;
    const auto rows = record.checksum_ok ? small_record_rows(type, record.payload, temperature)
                                         : fail(ErrorCode::bad_data, "");
    if (!rows) {
      ++tally.unreadable_records;
      continue;
    }
    ++tally.records;
    SIXPOINT_CHECK(sink(lines_of(record.unix_time, utc, *rows)));
  }
}

}  // namespace sixpoint::gt3x
