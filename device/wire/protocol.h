// Messages on the wire (docs/protocol.md), encoded and decoded.
//
//   const Report report = encode({ReportKind::request, 1, Command::identify, ReplyCode::ok, {}});
//   const Result<Message> message = decode(report);  // the same again
//
// The peer may be broken or hostile: a decoder checks every length, count, text and CRC, allocates
// no memory by a number that was received, and answers bad_data. The station (wire_unit.h) and the
// virtual units (mocks) use the same functions. Pure functions, safe from any thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "device/unit_types.h"

namespace sixpoint::device {

inline constexpr std::uint8_t kProtocolVersion = 1;
inline constexpr std::size_t kReportBytes = 64;
inline constexpr std::size_t kPayloadBytes = 54;
inline constexpr std::size_t kPageChunkBytes = 48;
inline constexpr std::size_t kSamplesPerReport = 6;

using Report = std::array<std::uint8_t, kReportBytes>;

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

// Numbers on the wire, counted from 0.
enum class ReplyCode : std::uint8_t {
  ok,
  unknown_command,
  bad_length,
  bad_argument,
  busy,
  no_such_recording,
  storage_full,
  battery_low,
  no_transaction,
  crc_mismatch,
  storage_fault,
  unsupported_version,
};

std::string_view to_string(Command command);
std::string_view to_string(ReplyCode code);

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

Bytes encode_identity(const Identity& identity);
Result<Identity> decode_identity(std::span<const std::uint8_t> payload);

Bytes encode_filter(const FilterState& state);
Result<FilterState> decode_filter(std::span<const std::uint8_t> payload);

Message encode_samples(const SampleBlock& block);
Result<SampleBlock> decode_samples(const Message& message);

struct RecordingEntry {
  std::uint16_t count = 0;  // how many recordings the unit holds
  RecordingInfo info;       // meaningless where count is 0
};
Bytes encode_recording(const RecordingEntry& entry);

// What a station believes of a unit's list (docs/protocol.md): a longer list is asked for entry by
// entry, and a recording is written to the disk until so many bytes came. No unit of the family has
// more than 4 GB of memory.
inline constexpr std::uint16_t kMostRecordings = 4096;
inline constexpr std::uint64_t kMostRecordingBytes = 4ULL << 30U;

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
