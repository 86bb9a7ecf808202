#include "device/wire/protocol.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <zlib.h>

#include "base/crc_ccitt.h"
#include "device/wire/payload.h"

namespace sixpoint::device {

namespace {

constexpr std::size_t kHeaderBytes = 8;
constexpr std::size_t kCrcOffset = kReportBytes - 2;

tl::unexpected<Error> damaged(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), "reply of the unit",
              "try again; a cable or a hub that does this often is broken");
}

Result<FilterConfiguration> filter_from(std::uint8_t value) {
  if (value > 1) {
    return damaged(fmt::format("there is no filter configuration {}", value));
  }
  return value == 0 ? FilterConfiguration::legacy : FilterConfiguration::current;
}

std::uint8_t to_byte(FilterConfiguration filter) {
  return filter == FilterConfiguration::legacy ? 0 : 1;
}

}  // namespace

std::string_view to_string(Command command) {
  constexpr std::array<std::string_view, 17> kNames = {
      "none",         "identify",    "read_page",       "begin_write",    "write_staged",
      "read_staged",  "commit",      "abort_write",     "get_filter",     "set_filter",
      "start_stream", "stop_stream", "start_recording", "stop_recording", "list_recording",
      "download",     "get_time"};
  const auto index = static_cast<std::size_t>(command);
  return index < kNames.size() ? kNames[index] : "unknown";
}

std::string_view to_string(ReplyCode code) {
  constexpr std::array<std::string_view, 12> kNames = {"ok",
                                                       "unknown command",
                                                       "bad length",
                                                       "bad argument",
                                                       "busy",
                                                       "no such recording",
                                                       "storage full",
                                                       "battery low",
                                                       "no transaction",
                                                       "CRC mismatch",
                                                       "storage fault",
                                                       "unsupported version"};
  const auto index = static_cast<std::size_t>(code);
  return index < kNames.size() ? kNames[index] : "unknown code";
}

Report encode(const Message& message) {
  Report report{};
  const std::size_t length = std::min(message.payload.size(), kPayloadBytes);
  report[0] = kProtocolVersion;
  report[1] = static_cast<std::uint8_t>(message.kind);
  report[2] = static_cast<std::uint8_t>(message.sequence & 0xFFU);
  report[3] = static_cast<std::uint8_t>(message.sequence >> 8U);
  report[4] = static_cast<std::uint8_t>(message.command);
  report[5] = static_cast<std::uint8_t>(message.code);
  report[6] = static_cast<std::uint8_t>(length);
  std::copy_n(message.payload.begin(), length, report.begin() + kHeaderBytes);
  const std::uint16_t crc = crc_ccitt(std::span(report).first(kCrcOffset));
  report[kCrcOffset] = static_cast<std::uint8_t>(crc & 0xFFU);
  report[kCrcOffset + 1] = static_cast<std::uint8_t>(crc >> 8U);
  return report;
}

Result<Message> decode(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kReportBytes) {
    return damaged(fmt::format("a report has {} bytes, not {}", kReportBytes, bytes.size()));
  }
  const auto crc = static_cast<std::uint16_t>(bytes[kCrcOffset] | (bytes[kCrcOffset + 1] << 8U));
  if (crc != crc_ccitt(bytes.first(kCrcOffset))) {
    return damaged("a report's CRC is wrong");
  }
  if (bytes[0] != kProtocolVersion) {
    return damaged(fmt::format("protocol version {} is not known", bytes[0]));
  }
  const std::size_t length = bytes[6];
  if (bytes[1] < 1 || bytes[1] > 3 || length > kPayloadBytes || bytes[7] != 0) {
    return damaged("a report's header makes no sense");
  }
  const auto padding = bytes.subspan(kHeaderBytes + length, kPayloadBytes - length);
  if (std::any_of(padding.begin(), padding.end(), [](std::uint8_t byte) { return byte != 0; })) {
    return damaged("a report's padding is not zero");
  }
  Message message;
  message.kind = static_cast<ReportKind>(bytes[1]);
  message.sequence = static_cast<std::uint16_t>(bytes[2] | (bytes[3] << 8U));
  message.command = static_cast<Command>(bytes[4]);
  message.code = static_cast<ReplyCode>(bytes[5]);
  const auto payload = bytes.subspan(kHeaderBytes, length);
  message.payload.assign(payload.begin(), payload.end());
  return message;
}

Bytes encode_identity(const Identity& identity) {
  PayloadWriter writer;
  writer.put(identity.version)
      .put(identity.kind)
      .put(identity.battery_mv)
      .put(identity.accel_scale_lsb_per_g)
      .put(identity.page_bytes);
  put_names(writer, identity);
  return writer.take();
}

Result<Identity> decode_identity(std::span<const std::uint8_t> payload) {
  PayloadReader reader(payload);
  Identity identity;
  identity.version = reader.get<std::uint8_t>();
  identity.kind = reader.get<std::uint8_t>();
  identity.battery_mv = reader.get<std::uint16_t>();
  identity.accel_scale_lsb_per_g = reader.get<std::uint16_t>();
  identity.page_bytes = reader.get<std::uint16_t>();
  const bool named = get_names(reader, identity);
  if (!reader.ok()) {
    return damaged("the identity is too short");
  }
  if (identity.version == 0 || identity.accel_scale_lsb_per_g == 0) {
    return damaged("the identity holds a version or a scale of zero");
  }
  if (!named) {
    return damaged("serial, firmware or model hold characters that no unit has");
  }
  return identity;
}

Bytes encode_filter(const FilterState& state) {
  return payload_of(to_byte(state.stream), to_byte(state.recording));
}

Result<FilterState> decode_filter(std::span<const std::uint8_t> payload) {
  PayloadReader reader(payload);
  const auto stream = reader.get<std::uint8_t>();
  const auto recording = reader.get<std::uint8_t>();
  if (!reader.ok()) {
    return damaged("the filter state is too short");
  }
  FilterState state;
  SIXPOINT_ASSIGN(state.stream, filter_from(stream));
  SIXPOINT_ASSIGN(state.recording, filter_from(recording));
  return state;
}

// Absolute zero: what claims to be colder is no temperature.
constexpr double kColdest_c = -273.15;

Message encode_samples(const SampleBlock& block) {
  PayloadWriter writer;
  const std::size_t count = std::min(block.counts.size(), kSamplesPerReport);
  writer.put(block.first_index)
      .put(block.device_time_us)
      .put(static_cast<std::int16_t>(
          std::lround(std::clamp(block.temperature_c, kColdest_c, 327.67) * 100)))
      .put(to_byte(block.filter))
      .put(static_cast<std::uint8_t>(count));
  for (std::size_t i = 0; i < count; ++i) {
    for (const std::int16_t lsb : block.counts[i]) {
      writer.put(lsb);
    }
  }
  return {ReportKind::samples, block.sequence, Command::none, ReplyCode::ok, writer.take()};
}

Result<SampleBlock> decode_samples(const Message& message) {
  if (message.kind != ReportKind::samples) {
    return damaged("a report holds no samples");
  }
  PayloadReader reader(message.payload);
  SampleBlock block;
  block.sequence = message.sequence;
  block.first_index = reader.get<std::uint32_t>();
  block.device_time_us = reader.get<std::uint64_t>();
  block.temperature_c = reader.get<std::int16_t>() / 100.0;
  if (block.temperature_c < kColdest_c) {
    return damaged("a samples report is colder than anything");
  }
  const auto filter = reader.get<std::uint8_t>();
  const auto count = reader.get<std::uint8_t>();
  if (!reader.ok() || count == 0 || count > kSamplesPerReport ||
      reader.left() != std::size_t{count} * 6) {
    return damaged("a report of samples has a wrong length");
  }
  SIXPOINT_ASSIGN(block.filter, filter_from(filter));
  block.counts.resize(count);
  for (RawCounts& counts : block.counts) {
    for (std::int16_t& lsb : counts) {
      lsb = reader.get<std::int16_t>();
    }
  }
  return block;
}

Bytes encode_recording(const RecordingEntry& entry) {
  PayloadWriter writer;
  writer.put(entry.count);
  if (entry.count != 0) {
    writer.put(entry.info.id)
        .put(entry.info.bytes)
        .put(entry.info.start_unix_time)
        .put(std::span<const std::uint8_t>(entry.info.sha256));
  }
  return writer.take();
}

Result<RecordingEntry> decode_recording(std::span<const std::uint8_t> payload) {
  PayloadReader reader(payload);
  RecordingEntry entry;
  entry.count = reader.get<std::uint16_t>();
  if (reader.ok() && entry.count == 0) {
    return entry;
  }
  entry.info.id = reader.get<std::uint16_t>();
  entry.info.bytes = reader.get<std::uint64_t>();
  entry.info.start_unix_time = reader.get<std::uint32_t>();
  const auto digest = reader.take(entry.info.sha256.size());
  if (!reader.ok()) {
    return damaged("the entry of a recording is too short");
  }
  if (entry.count > kMostRecordings) {
    return damaged(
        fmt::format("a list of {} recordings, of {} at most", entry.count, kMostRecordings));
  }
  if (entry.info.bytes > kMostRecordingBytes) {
    return damaged(fmt::format("a recording of {} bytes, of {} at most", entry.info.bytes,
                               kMostRecordingBytes));
  }
  std::copy(digest.begin(), digest.end(), entry.info.sha256.begin());
  return entry;
}

Bytes encode_bulk(const BulkBlock& block) {
  constexpr std::string_view kMagic = "S6B1";
  PayloadWriter writer;
  const auto content = block.content.first(std::min(block.content.size(), kBulkContentBytes));
  writer.put(kMagic, kMagic.size())
      .put(block.recording)
      .put(static_cast<std::uint16_t>(block.last ? 1 : 0))
      .put(block.offset)
      .put(static_cast<std::uint32_t>(content.size()))
      .put(content);
  Bytes bytes = writer.take();
  const auto crc =
      static_cast<std::uint32_t>(::crc32(0, bytes.data(), static_cast<unsigned>(bytes.size())));
  for (unsigned shift = 0; shift < 32; shift += 8) {
    bytes.push_back(static_cast<std::uint8_t>((crc >> shift) & 0xFFU));
  }
  return bytes;
}

Result<BulkBlock> decode_bulk(std::span<const std::uint8_t> bytes) {
  if (bytes.size() <= kBulkHeaderBytes + 4 || bytes.size() > kBulkBlockBytes) {
    return damaged(fmt::format("a bulk block has {} bytes", bytes.size()));
  }
  PayloadReader tail(bytes.last(4));
  const auto before = bytes.first(bytes.size() - 4);
  if (tail.get<std::uint32_t>() !=
      static_cast<std::uint32_t>(::crc32(0, before.data(), static_cast<unsigned>(before.size())))) {
    return damaged("a bulk block's CRC is wrong");
  }
  PayloadReader reader(before);
  const std::string magic = reader.text(4);
  BulkBlock block;
  block.recording = reader.get<std::uint16_t>();
  block.last = (reader.get<std::uint16_t>() & 1U) != 0;
  block.offset = reader.get<std::uint64_t>();
  const auto length = reader.get<std::uint32_t>();
  if (magic != "S6B1" || length == 0 || length != reader.left()) {
    return damaged("a bulk block's header makes no sense");
  }
  block.content = reader.take(length);
  return block;
}

}  // namespace sixpoint::device
