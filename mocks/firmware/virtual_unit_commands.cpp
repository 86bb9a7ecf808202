// What a virtual unit answers to each command of docs/protocol.md.
#include <algorithm>
#include <array>
#include <cmath>

#include "base/crc_ccitt.h"
#include "device/wire/payload.h"
#include "mocks/firmware/virtual_unit.h"
#include "sim/recording.h"

namespace sixpoint::mocks {

namespace {

using device::Command;
using device::Message;
using device::payload_of;
using device::PayloadReader;
using device::ReplyCode;
using device::ReportKind;

constexpr std::uint16_t kLowBattery_mv = 3300;
constexpr std::uint64_t kLeastFlash_bytes = 64U << 10U;  // below it no recording begins
constexpr std::size_t kAnyLength = SIZE_MAX;             // the command checks it itself

bool rate_exists(int rate_hz) { return rate_hz >= 30 && rate_hz <= 100 && rate_hz % 10 == 0; }

// Whether a chunk of a page lies within it.
bool is_chunk(std::size_t offset, std::size_t length, std::size_t page_bytes) {
  return length > 0 && length <= device::kPageChunkBytes && offset + length <= page_bytes;
}

void copy_chunk(const Bytes& page, std::size_t offset, std::size_t length, Bytes& out) {
  const auto begin = page.begin() + static_cast<std::ptrdiff_t>(offset);
  out.assign(begin, begin + static_cast<std::ptrdiff_t>(length));
}

// The payload of a request and of its reply, and the time.
struct Exchange {
  PayloadReader in;
  Bytes out;
  nanoseconds now;
};

}  // namespace

struct VirtualUnit::Commands {
  struct Row {
    Command command;
    std::size_t request_bytes;  // exact length of the request's payload
    ReplyCode (*answer)(VirtualUnit& unit, Exchange& exchange);
  };

  static ReplyCode identify(VirtualUnit& unit, Exchange& exchange) {
    device::Identity identity;
    identity.battery_mv = unit.options_.battery_mv;
    identity.accel_scale_lsb_per_g =
        static_cast<std::uint16_t>(std::lround(unit.options_.truth.accel_scale_lsb_per_g));
    identity.serial = unit.options_.truth.serial;
    identity.firmware = unit.options_.truth.firmware;
    identity.model = sim::device_type_of(unit.options_.truth.serial);
    exchange.out = device::encode_identity(identity);
    return ReplyCode::ok;
  }

  static ReplyCode read_page(VirtualUnit& unit, Exchange& exchange) {
    const auto page = exchange.in.get<std::uint8_t>();
    const auto offset = exchange.in.get<std::uint16_t>();
    const auto length = exchange.in.get<std::uint8_t>();
    if (page != device::kCalibrationPage || !is_chunk(offset, length, device::kPageBytes)) {
      return ReplyCode::bad_argument;
    }
    const auto bytes = unit.memory_.read();
    if (!bytes) {
      return ReplyCode::storage_fault;
    }
    copy_chunk(*bytes, offset, length, exchange.out);
    return ReplyCode::ok;
  }

  static ReplyCode begin_write(VirtualUnit& unit, Exchange& exchange) {
    const auto page = exchange.in.get<std::uint8_t>();
    const auto length = exchange.in.get<std::uint16_t>();
    const auto crc = exchange.in.get<std::uint16_t>();
    if (page != device::kCalibrationPage || length != device::kPageBytes) {
      return ReplyCode::bad_argument;
    }
    unit.staged_ = Staged{Bytes(length, 0xFF), crc};
    return ReplyCode::ok;
  }

  static ReplyCode write_staged(VirtualUnit& unit, Exchange& exchange) {
    const auto offset = exchange.in.get<std::uint16_t>();
    const auto bytes = exchange.in.take(exchange.in.left());
    if (!exchange.in.ok() || bytes.empty() || bytes.size() > device::kPageChunkBytes) {
      return ReplyCode::bad_length;
    }
    if (!unit.staged_) {
      return ReplyCode::no_transaction;
    }
    if (!is_chunk(offset, bytes.size(), unit.staged_->bytes.size())) {
      return ReplyCode::bad_argument;
    }
    std::copy(bytes.begin(), bytes.end(), unit.staged_->bytes.begin() + offset);
    return ReplyCode::ok;
  }

  static ReplyCode read_staged(VirtualUnit& unit, Exchange& exchange) {
    const auto offset = exchange.in.get<std::uint16_t>();
    const auto length = exchange.in.get<std::uint8_t>();
    if (!unit.staged_) {
      return ReplyCode::no_transaction;
    }
    if (!is_chunk(offset, length, unit.staged_->bytes.size())) {
      return ReplyCode::bad_argument;
    }
    copy_chunk(unit.staged_->bytes, offset, length, exchange.out);
    return ReplyCode::ok;
  }

  static ReplyCode commit(VirtualUnit& unit, Exchange& exchange) {
    const auto crc = exchange.in.get<std::uint16_t>();
    if (!unit.staged_) {
      return ReplyCode::no_transaction;
    }
    if (unit.recording_) {
      return ReplyCode::busy;
    }
    if (unit.options_.battery_mv < kLowBattery_mv) {
      return ReplyCode::battery_low;
    }
    if (crc != unit.staged_->crc || crc != crc_ccitt(unit.staged_->bytes)) {
      return ReplyCode::crc_mismatch;
    }
    if (!unit.memory_.write(unit.staged_->bytes)) {
      if (!unit.memory_.has_power()) {
        unit.cut_power(exchange.now);
      }
      return ReplyCode::storage_fault;
    }
    unit.staged_.reset();
    const sim::FilterConfiguration filter = unit.stream_filter_;
    unit.load_page();
    unit.stream_filter_ = filter;  // SET_FILTER holds until power-off
    exchange.out = payload_of(crc_ccitt(unit.memory_.read().value_or(Bytes{})));
    return ReplyCode::ok;
  }

  static ReplyCode abort_write(VirtualUnit& unit, Exchange& /*exchange*/) {
    unit.staged_.reset();
    return ReplyCode::ok;
  }

  static ReplyCode get_filter(VirtualUnit& unit, Exchange& exchange) {
    exchange.out = device::encode_filter({unit.stream_filter_, unit.recording_filter()});
    return ReplyCode::ok;
  }

  static ReplyCode set_filter(VirtualUnit& unit, Exchange& exchange) {
    const auto filter = exchange.in.get<std::uint8_t>();
    if (filter > 1) {
      return ReplyCode::bad_argument;
    }
    if (unit.stream_) {
      return ReplyCode::busy;
    }
    unit.stream_filter_ =
        filter == 0 ? sim::FilterConfiguration::legacy : sim::FilterConfiguration::current;
    return ReplyCode::ok;
  }

  static ReplyCode start_stream(VirtualUnit& unit, Exchange& exchange) {
    const int rate_hz = exchange.in.get<std::uint16_t>();
    if (unit.recording_) {
      return ReplyCode::busy;
    }
    if (!rate_exists(rate_hz)) {
      return ReplyCode::bad_argument;
    }
    unit.stream_ = Stream{
        exchange.now, rate_hz,
        std::make_unique<sim::Simulator>(
            unit.options_.truth, unit.simulator_options(rate_hz, unit.stream_filter_, exchange.now),
            *unit.poses_, unit.effects())};
    return ReplyCode::ok;
  }

  static ReplyCode stop_stream(VirtualUnit& unit, Exchange& exchange) {
    const std::uint64_t samples = unit.stream_ ? unit.stream_->simulator->samples() : 0;
    unit.stream_.reset();
    exchange.out = payload_of(static_cast<std::uint32_t>(samples));
    return ReplyCode::ok;
  }

  static ReplyCode start_recording(VirtualUnit& unit, Exchange& exchange) {
    const int rate_hz = exchange.in.get<std::uint16_t>();
    const auto unix_time_s = exchange.in.get<std::uint32_t>();
    if (unit.recording_ || unit.stream_) {
      return ReplyCode::busy;
    }
    if (!rate_exists(rate_hz)) {
      return ReplyCode::bad_argument;
    }
    if (unit.options_.battery_mv < kLowBattery_mv) {
      return ReplyCode::battery_low;
    }
    if (unit.flash_full_since_ || unit.flash_left() < kLeastFlash_bytes ||
        unit.images_.size() >= device::kMostRecordings) {
      return ReplyCode::storage_full;
    }
    unit.clock_set_to_ = from_unix_seconds(unix_time_s);
    unit.clock_set_at_ = exchange.now;
    unit.recording_ = RecordingRun{exchange.now, rate_hz, unit.clock_set_to_};
    exchange.out = payload_of(static_cast<std::uint16_t>(unit.images_.size() + 1));
    return ReplyCode::ok;
  }

  static ReplyCode stop_recording(VirtualUnit& unit, Exchange& exchange) {
    if (!unit.recording_) {
      return ReplyCode::no_such_recording;
    }
    unit.finish_recording(exchange.now);
    exchange.out = payload_of(static_cast<std::uint16_t>(unit.images_.size()));
    return ReplyCode::ok;
  }

  static ReplyCode list_recording(VirtualUnit& unit, Exchange& exchange) {
    const auto index = exchange.in.get<std::uint16_t>();
    device::RecordingEntry entry;
    entry.count = static_cast<std::uint16_t>(unit.infos_.size());
    if (index < unit.infos_.size()) {
      entry.info = unit.infos_[index];
    } else if (index != 0) {
      return ReplyCode::no_such_recording;
    }
    exchange.out = device::encode_recording(entry);
    return ReplyCode::ok;
  }

  static ReplyCode download(VirtualUnit& unit, Exchange& exchange) {
    const auto id = exchange.in.get<std::uint16_t>();
    const auto offset = exchange.in.get<std::uint64_t>();
    const auto length = exchange.in.get<std::uint32_t>();
    if (unit.recording_) {
      return ReplyCode::busy;
    }
    if (id == 0 || id > unit.images_.size()) {
      return ReplyCode::no_such_recording;
    }
    const std::uint64_t size = unit.images_[id - 1U].size();
    if (offset > size) {
      return ReplyCode::bad_argument;
    }
    const std::uint64_t promised = std::min<std::uint64_t>(length, size - offset);
    ++unit.downloads_;
    unit.download_ = Download{id, offset, offset + promised};
    exchange.out = payload_of(promised);
    return ReplyCode::ok;
  }

  static ReplyCode get_time(VirtualUnit& unit, Exchange& exchange) {
    const UtcTime calendar =
        unit.clock_set_to_ + (exchange.now - unit.clock_set_at_) +
        (unit.jumped_until(exchange.now) - unit.jumped_until(unit.clock_set_at_));
    exchange.out = payload_of(unit.device_time_us(exchange.now),
                              static_cast<std::uint32_t>(to_unix_seconds(calendar)));
    return ReplyCode::ok;
  }

  static constexpr std::array<Row, 16> kTable = {{
      {Command::identify, 0, identify},
      {Command::read_page, 4, read_page},
      {Command::begin_write, 5, begin_write},
      {Command::write_staged, kAnyLength, write_staged},
      {Command::read_staged, 3, read_staged},
      {Command::commit, 2, commit},
      {Command::abort_write, 0, abort_write},
      {Command::get_filter, 0, get_filter},
      {Command::set_filter, 1, set_filter},
      {Command::start_stream, 2, start_stream},
      {Command::stop_stream, 0, stop_stream},
      {Command::start_recording, 6, start_recording},
      {Command::stop_recording, 0, stop_recording},
      {Command::list_recording, 2, list_recording},
      {Command::download, 14, download},
      {Command::get_time, 0, get_time},
  }};
};

void VirtualUnit::take_report(std::span<const std::uint8_t> report, nanoseconds now) {
  if (!powered_) {
    return;
  }
  auto request = device::decode(report);
  if (!request) {
    answer_other_version(report);
    return;
  }
  if (request->kind != ReportKind::request) {
    return;
  }
  if (request->sequence != 0 && last_request_ == *request) {
    replies_.put(last_reply_);
    return;
  }
  const Message reply = answer(*request, now);
  if (!powered_) {
    return;  // power failed while the command was executed
  }
  last_reply_ = device::encode(reply);
  last_request_ = std::move(*request);
  replies_.put(last_reply_);
}

// A whole report of another protocol version gets an answer; everything else is noise on the cable.
void VirtualUnit::answer_other_version(std::span<const std::uint8_t> report) {
  if (report.size() != device::kReportBytes || report[0] == device::kProtocolVersion) {
    return;
  }
  const std::uint16_t crc = crc_ccitt(report.first(device::kReportBytes - 2));
  if (report[62] == (crc & 0xFFU) && report[63] == (crc >> 8U)) {
    replies_.put(device::encode({ReportKind::reply,
                                 static_cast<std::uint16_t>(report[2] | (report[3] << 8U)),
                                 static_cast<Command>(report[4]),
                                 ReplyCode::unsupported_version,
                                 {}}));
  }
}

Message VirtualUnit::answer(const Message& request, nanoseconds now) {
  Message reply{ReportKind::reply, request.sequence, request.command, ReplyCode::ok, {}};
  const auto* const row =
      std::find_if(Commands::kTable.begin(), Commands::kTable.end(),
                   [&](const Commands::Row& entry) { return entry.command == request.command; });
  if (row == Commands::kTable.end()) {
    reply.code = ReplyCode::unknown_command;
  } else if (row->request_bytes != kAnyLength && row->request_bytes != request.payload.size()) {
    reply.code = ReplyCode::bad_length;
  } else {
    Exchange exchange{PayloadReader(request.payload), {}, now};
    reply.code = row->answer(*this, exchange);
    if (reply.code == ReplyCode::ok) {
      reply.payload = std::move(exchange.out);
    }
  }
  return reply;
}

}  // namespace sixpoint::mocks
