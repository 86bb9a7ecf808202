#include "gt3x/rows/imu_csv.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "gt3x/forms/sensor_schema.h"
#include "gt3x/rows/csv_header.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::string_view kLineEnd = "\r\n";

// "2019-02-14T08:58:00", of the recording's own clock.
std::string second_text(std::uint32_t unix_time) {
  std::string text = to_iso8601(from_unix_seconds(unix_time));
  text.pop_back();  // Z
  return text;
}

// Six decimals, half-way cases away from zero, without trailing zeros.
void append_value(std::string& line, double value) {
  constexpr double kDecimals = 1e6;
  std::string text = fmt::format("{:.6f}", std::round(value * kDecimals) / kDecimals);
  text.resize(text.find_last_not_of('0') + 1);
  if (text.back() == '.') {
    text.pop_back();
  }
  line += text == "-0" ? "0" : text;
}

std::string csv_header(const Info& info, std::uint32_t start, const SensorSchema& schema) {
  std::string text = csv_header(info,
                                fmt::format("Created By Sixpoint in the form of ActiGraph Link IMU "
                                            "9DOF Sensor Firmware v{} date format M/d/yyyy at {} "
                                            "Hz ",
                                            printable(info.firmware(), 40), kImuRate_hz),
                                start);
  text += "Timestamp";
  for (const std::string& label : schema.labels()) {
    text.append(",").append(printable(label, 40));
  }
  text += kLineEnd;
  return text;
}

std::string second_lines(std::uint32_t unix_time, const std::vector<std::vector<double>>& samples) {
  const std::string second = second_text(unix_time);
  std::string text;
  for (std::size_t j = 0; j < kImuRate_hz; ++j) {
    const double at = static_cast<double>(j * samples.size()) / kImuRate_hz;
    const auto before = static_cast<std::size_t>(at);
    const std::size_t after = std::min(before + 1, samples.size() - 1);
    const double part = at - static_cast<double>(before);
    text += fmt::format("{}.{:02}00000", second, j);
    for (std::size_t column = 0; column < samples[before].size(); ++column) {
      text += ',';
      append_value(text, samples[before][column] * (1 - part) + samples[after][column] * part);
    }
    text += kLineEnd;
  }
  return text;
}

// The schemas of a recording, by number. The columns of the CSV are those of the first.
class Schemas {
 public:
  // False for a payload that cannot be read.
  bool take(std::span<const std::uint8_t> payload) {
    auto parsed = parse_sensor_schema(payload);
    constexpr std::size_t kMost = 64;  // real units write one
    if (!parsed || (by_id_.size() == kMost && !by_id_.contains(parsed->id))) {
      return false;
    }
    if (by_id_.empty()) {
      labels_ = parsed->labels();
    }
    auto& known = by_id_[parsed->id];
    known.reset();
    if (parsed->labels() == labels_) {
      known = *std::move(parsed);
    }
    return true;
  }

  bool empty() const { return by_id_.empty(); }

  // Null where no schema has this number; nothing in it where that one has other columns.
  const std::optional<SensorSchema>* find(std::uint16_t id) const {
    const auto found = by_id_.find(id);
    return found == by_id_.end() ? nullptr : &found->second;
  }

 private:
  std::vector<std::string> labels_;
  std::map<std::uint16_t, std::optional<SensorSchema>> by_id_;
};

}  // namespace

Result<ImuCsvTally> write_imu_csv(Recording& recording, const TextSink& sink) {
  SIXPOINT_ASSIGN(LogReader log, recording.open_log());
  ImuCsvTally tally;
  Schemas schemas;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      break;
    }
    const Record& record = item->record;
    if (item->kind != LogItem::Kind::record ||
        !(record.is(RecordType::sensor_schema) || record.is(RecordType::sensor_data))) {
      continue;
    }
    if (!record.checksum_ok) {
      ++tally.unreadable_records;
      continue;
    }
    if (record.is(RecordType::sensor_schema)) {
      tally.unreadable_records += schemas.take(record.payload) ? 0 : 1;
      continue;
    }
    const auto id = schema_of_sensor_data(record.payload);
    const auto* schema = id ? schemas.find(*id) : nullptr;
    if (schema != nullptr && !*schema) {
      ++tally.other_columns;
      continue;
    }
    const auto samples = schema != nullptr ? parse_sensor_data(**schema, record.payload)
                                           : fail(ErrorCode::bad_data, "");
    if (!samples || samples->empty()) {
      ++tally.unreadable_records;
      continue;
    }
    if (tally.seconds == 0) {
      SIXPOINT_CHECK(sink(csv_header(recording.info(), record.unix_time, **schema)));
    }
    ++tally.seconds;
    tally.samples += samples->size();
    tally.resampled_seconds += samples->size() == kImuRate_hz ? 0 : 1;
    SIXPOINT_CHECK(sink(second_lines(record.unix_time, *samples)));
  }
  if (tally.seconds == 0) {
    return fail(ErrorCode::bad_data,
                schemas.empty()
                    ? "the recording holds no description of an inertial sensor (SENSOR_SCHEMA)"
                    : "the recording holds no data of an inertial sensor",
                recording.path(), "only a GT9X Link with the IMU switched on records it");
  }
  return tally;
}

}  // namespace sixpoint::gt3x
