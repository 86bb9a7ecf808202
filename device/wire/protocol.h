// Messages on the wire (docs/protocol.md), encoded and decoded.
//
// Decoders take bytes from a peer that may be broken or hostile: every length, count, text and CRC
// is checked, nothing is allocated on the strength of a number that was received, and what does not
// hold is bad_data. Both ends use these functions, the station (unit.h) and virtual units (mocks).
// Pure functions, safe from any thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "base/measure.h"
#include "base/sha256.h"
#include "calib/constants.h"

namespace sixpoint::device {

using calib::FilterConfiguration;

inline constexpr std::uint8_t kProtocolVersion = 1;
inline constexpr std::size_t kReportBytes = 64;
inline constexpr std::size_t kPayloadBytes = 54;
inline constexpr std::size_t kPageChunkBytes = 48;
inline constexpr std::size_t kSamplesPerReport = 6;

using Report = std::array<std::uint8_t, kReportBytes>;
// One reading of the sensor, unscaled, in raw counts.
using RawCounts = PerAxis<std::int16_t>;

enum class ReportKind : std::uint8_t { request = 1, reply = 2, samples = 3 };

enum class Command : std::uint8_t {
  none = 0,
  identify = 1,
  read_page = 2,
  begin_write = 3,
  write_staged = 4,
  read_staged = 5,
  commit = 6,
  abort_write = 7,
  get_filter = 8,
  set_filter = 9,
  start_stream = 10,
  stop_stream = 11,
  start_recording = 12,
  stop_recording = 13,
  list_recording = 14,
  download = 15,
  get_time = 16,
};

enum class ReplyCode : std::uint8_t {
  ok = 0,
  unknown_command = 1,
  bad_length = 2,
  bad_argument = 3,
  busy = 4,
  no_such_recording = 5,
  storage_full = 6,
  battery_low = 7,
  no_transaction = 8,
  crc_mismatch = 9,
  storage_fault = 10,
  unsupported_version = 11,
};

std::string_view to_string(Command command);
std::string_view to_string(ReplyCode code);

// CRC-CCITT, polynomial 0x1021, start 0xFFFF, not reflected: "123456789" gives 0x29B1.
std::uint16_t crc_ccitt(std::span<const std::uint8_t> bytes);

struct Message {
  ReportKind kind = ReportKind::request;
  std::uint16_t sequence = 0;
  Command command = Command::none;
  ReplyCode code = ReplyCode::ok;
  Bytes payload;  // at most kPayloadBytes

  bool operator==(const Message&) const = default;
};

// A payload above kPayloadBytes is a defect of the caller and is cut.
Report encode(const Message& message);
// `bytes` is what one read gave: anything but one whole report is bad_data.
Result<Message> decode(std::span<const std::uint8_t> bytes);

struct Identity {
  std::uint8_t version = kProtocolVersion;
  std::uint8_t kind = 0;  // 0 = activity monitor
  std::uint16_t battery_mv = 0;
  std::uint16_t accel_scale_lsb_per_g = 256;
  std::uint16_t page_bytes = 512;
  std::string serial;    // at most 16 characters, printable ASCII without blanks
  std::string firmware;  // at most 12, such as "1.5.0"
  std::string model;     // at most 12, such as "wGT3XBT"

  bool operator==(const Identity&) const = default;
};
Bytes encode_identity(const Identity& identity);
Result<Identity> decode_identity(std::span<const std::uint8_t> payload);

struct FilterState {
  FilterConfiguration stream = FilterConfiguration::current;
  // What this unit's firmware chooses for recordings, by its calibration date.
  FilterConfiguration recording = FilterConfiguration::current;

  bool operator==(const FilterState&) const = default;
};
Bytes encode_filter(const FilterState& state);
Result<FilterState> decode_filter(std::span<const std::uint8_t> payload);

struct SampleBlock {
  std::uint16_t sequence = 0;  // of the report
  std::uint32_t first_index = 0;
  std::uint64_t device_time_us = 0;
  double temperature_c = 0;  // of the die, in steps of 0.01
  FilterConfiguration filter = FilterConfiguration::current;
  std::vector<RawCounts> counts;  // 1 to kSamplesPerReport

  bool operator==(const SampleBlock&) const = default;
};
Message encode_samples(const SampleBlock& block);
Result<SampleBlock> decode_samples(const Message& message);

struct RecordingInfo {
  std::uint16_t id = 0;
  std::uint64_t bytes = 0;
  std::uint32_t start_unix_time = 0;
  Sha256Digest sha256{};

  bool operator==(const RecordingInfo&) const = default;
};
struct RecordingEntry {
  std::uint16_t count = 0;  // how many recordings the unit holds
  RecordingInfo info;       // meaningless where count is 0
};
Bytes encode_recording(const RecordingEntry& entry);
Result<RecordingEntry> decode_recording(std::span<const std::uint8_t> payload);

inline constexpr std::size_t kBulkHeaderBytes = 20;
inline constexpr std::size_t kBulkContentBytes = 16384;
inline constexpr std::size_t kBulkBlockBytes = kBulkHeaderBytes + kBulkContentBytes + 4;

struct BulkBlock {
  std::uint16_t recording = 0;
  bool last = false;
  std::uint64_t offset = 0;
  std::span<const std::uint8_t> content;  // into the bytes that were decoded
};
Bytes encode_bulk(const BulkBlock& block);
Result<BulkBlock> decode_bulk(std::span<const std::uint8_t> bytes);

}  // namespace sixpoint::device
