#include "device/wire/wire_unit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "base/crc_ccitt.h"
#include "device/wire/calibration_page.h"
#include "device/wire/payload.h"
#include "gt3x/forms/model.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;

const char* hint_for(ReplyCode code) {
  switch (code) {
    case ReplyCode::busy:
      return "stop the recording or the stream first";
    case ReplyCode::battery_low:
      return "charge the unit";
    case ReplyCode::storage_full:
      return "download and clear the unit's recordings";
    case ReplyCode::no_such_recording:
      return "list the unit's recordings again";
    case ReplyCode::crc_mismatch:
    case ReplyCode::no_transaction:
      return "try again; the unit still holds its old constants";
    case ReplyCode::storage_fault:
      return "try again; if it stays, the unit's memory is worn out";
    default:
      return "update the unit's firmware or this program";
  }
}

tl::unexpected<Error> swapped(const std::string& where, const std::string& was,
                              const std::string& is) {
  return fail(ErrorCode::device_unavailable, fmt::format("the unit was {} and is now {}", was, is),
              where, "put the first unit back, or begin anew with this one");
}

// Its serial is the one that the files of this unit are known by.
Result<Identity> identity_in(std::span<const std::uint8_t> payload) {
  SIXPOINT_ASSIGN(Identity identity, decode_identity(payload));
  identity.serial = gt3x::unit_serial(identity.serial);
  return identity;
}

}  // namespace

tl::unexpected<Error> WireUnit::bad_answer(std::string what) const {
  return fail(ErrorCode::bad_data, std::move(what), link_.address,
              "plug the unit in again; if it stays, the unit or its firmware is faulty");
}

Result<std::unique_ptr<Unit>> WireUnit::open(Link link, WireOptions options) {
  std::unique_ptr<WireUnit> unit(new WireUnit(std::move(link), options));
  SIXPOINT_CHECK(unit->introduce({}));
  return std::unique_ptr<Unit>(std::move(unit));
}

Status WireUnit::introduce(const std::string& expected) {
  SIXPOINT_ASSIGN(const Bytes payload, ask(Command::identify, {}, true));
  SIXPOINT_ASSIGN(const Identity identity, identity_in(payload));
  if (!link_.serial.empty() && gt3x::unit_serial(link_.serial) != identity.serial) {
    return bad_answer(fmt::format("the unit is {} by its USB descriptor and {} by its own answer",
                                  printable(link_.serial, 80), identity.serial));
  }
  identity_is_another_ = !expected.empty() && identity.serial != expected;
  if (identity_is_another_) {
    return swapped(link_.address, expected, identity.serial);
  }
  identity_ = identity;
  return {};
}

Status WireUnit::reconnect(nanoseconds patience, const std::function<Status()>& look) {
  const nanoseconds deadline = link_.clock->elapsed() + patience;
  const std::string serial = identity_.serial;
  streaming_ = false;
  // Perhaps only its firmware restarted and the link still works.
  Status answer = introduce(serial);
  std::string hint = "plug it in again and begin anew";
  while (!answer && !identity_is_another_ && link_.reopen && !cancelled_) {
    if (link_.clock->elapsed() >= deadline) {
      return fail(ErrorCode::device_unavailable,
                  fmt::format("the unit {} went away and did not come back within {:.0f} s", serial,
                              std::chrono::duration<double>(patience).count()),
                  link_.address, hint);
    }
    if (look) {
      SIXPOINT_CHECK(look());
    }
    link_.clock->sleep(options_.reopen_interval);
    Result<Link> again = link_.reopen();
    if (!again) {
      hint = again.error().hint;  // names what is plugged in instead
      continue;
    }
    {
      const std::lock_guard lock(channels_mutex_);
      link_.reports = std::move(again->reports);
      link_.bulk = std::move(again->bulk);
      link_.serial = std::move(again->serial);
    }
    answer = introduce(serial);
  }
  return answer;
}

Result<Identity> WireUnit::identify() {
  SIXPOINT_ASSIGN(const Bytes payload, ask(Command::identify));
  SIXPOINT_ASSIGN(Identity identity, identity_in(payload));
  if (identity.serial != identity_.serial) {
    return swapped(link_.address, identity_.serial, identity.serial);
  }
  identity_ = identity;
  return identity;
}

void WireUnit::cancel() {
  cancelled_ = true;
  const std::lock_guard lock(channels_mutex_);
  link_.reports->cancel();
  if (link_.bulk) {
    link_.bulk->cancel();
  }
}

Result<std::optional<Message>> WireUnit::receive(nanoseconds time_out) {
  // One byte more than a report, so that a longer one is found.
  std::array<std::uint8_t, kReportBytes + 1> buffer{};
  const Result<std::size_t> count = link_.reports->read(buffer, time_out);
  if (!count) {
    if (count.error().code != ErrorCode::io) {
      return fail(count.error());
    }
    ++statistics_.failed_transfers;
    link_.clock->sleep(options_.after_failure);
    return std::nullopt;
  }
  if (*count == 0) {
    return std::nullopt;
  }
  Result<Message> message = decode(std::span(buffer).first(std::min(*count, buffer.size())));
  if (!message || message->kind == ReportKind::request) {
    ++statistics_.damaged_reports;
    return std::nullopt;
  }
  return std::optional<Message>(std::move(*message));
}

void WireUnit::take_samples(const Message& message) {
  if (!streaming_) {
    return;  // was under way when the stream stopped
  }
  Result<SampleBlock> block = decode_samples(message);
  if (!block) {
    ++statistics_.damaged_reports;
    return;
  }
  // Indices wrap at 2^32: compare by signed distance.
  const auto ahead = static_cast<std::int32_t>(block->first_index - next_index_.value_or(0));
  if (ahead < 0) {
    ++statistics_.duplicate_reports;
    return;
  }
  if (last_block_) {
    // Report sequence and sample index must agree on whether something is missing. A block in which
    // they do not is damaged, although its CRC fits.
    const bool follows = block->sequence == static_cast<std::uint16_t>(last_block_->sequence + 1U);
    if (follows != (ahead == 0)) {
      ++statistics_.damaged_reports;
      return;
    }
  }
  if (waiting_.size() >= options_.waiting_blocks) {
    ++statistics_.overflowed_blocks;
    return;  // shows as lost samples when the next block is taken
  }
  if (last_block_ && rate_hz_ > 0) {
    // Crystals are off by 0.01 %, resonators by 2 %; more is no drift.
    const double expected_s =
        static_cast<std::uint32_t>(block->first_index - last_block_->first_index) /
        static_cast<double>(rate_hz_);
    const double passed_s = static_cast<double>(static_cast<std::int64_t>(
                                block->device_time_us - last_block_->device_time_us)) *
                            1e-6;
    if (std::abs(passed_s - expected_s) > 0.05 + 0.05 * expected_s) {
      ++statistics_.clock_jumps;
      statistics_.clock_jumped_s += passed_s - expected_s;
    }
  }
  last_block_ = LastBlock{block->first_index, block->sequence, block->device_time_us};
  statistics_.lost_samples += static_cast<std::uint64_t>(ahead);
  statistics_.samples += block->counts.size();
  next_index_ = block->first_index + static_cast<std::uint32_t>(block->counts.size());
  waiting_.push_back(std::move(*block));
}

Result<Bytes> WireUnit::ask(Command command, Bytes payload, bool first) {
  if (first) {
    sequence_ = 0;
  } else {
    sequence_ = sequence_ == 0xFFFF ? std::uint16_t{1} : static_cast<std::uint16_t>(sequence_ + 1);
  }
  const Report report =
      encode({ReportKind::request, sequence_, command, ReplyCode::ok, std::move(payload)});
  const nanoseconds patience =
      command == Command::commit ? options_.commit_time_out : options_.reply_time_out;
  for (int attempt = 0; attempt < options_.attempts; ++attempt) {
    const Status written = link_.reports->write(report, patience);
    if (!written) {
      if (written.error().code != ErrorCode::io) {
        return fail(written.error());
      }
      // A transfer that failed may be repeated like one that got lost.
      ++statistics_.failed_transfers;
      link_.clock->sleep(options_.after_failure);
      continue;
    }
    const nanoseconds deadline = link_.clock->elapsed() + patience;
    for (nanoseconds left = patience; left > nanoseconds::zero();
         left = deadline - link_.clock->elapsed()) {
      SIXPOINT_ASSIGN(const auto message, receive(left));
      if (!message) {
        continue;
      }
      if (message->kind == ReportKind::samples) {
        take_samples(*message);
      } else if (message->sequence == sequence_ && message->command == command) {
        if (message->code != ReplyCode::ok) {
          return fail(ErrorCode::io,
                      fmt::format("the unit refused '{}': {}", to_string(command),
                                  to_string(message->code)),
                      link_.address, hint_for(message->code));
        }
        return message->payload;
      }
    }
  }
  return fail(ErrorCode::device_unavailable,
              fmt::format("the unit does not answer '{}'", to_string(command)), link_.address,
              "unplug the unit and plug it in again");
}

Result<Bytes> WireUnit::read_page() {
  Bytes page;
  while (page.size() < kPageBytes) {
    const auto offset = static_cast<std::uint16_t>(page.size());
    const auto length =
        static_cast<std::uint8_t>(std::min(kPageChunkBytes, kPageBytes - page.size()));
    SIXPOINT_ASSIGN(const Bytes chunk,
                    ask(Command::read_page, payload_of(kCalibrationPage, offset, length)));
    if (chunk.size() != length) {
      return bad_answer("a part of the calibration page has the wrong length");
    }
    page.insert(page.end(), chunk.begin(), chunk.end());
  }
  return page;
}

Result<CalibrationPage> WireUnit::read_calibration() {
  SIXPOINT_ASSIGN(const Bytes page, read_page());
  return decode_calibration_page(page);
}

Status WireUnit::write_calibration(const CalibrationPage& page) {
  // The constants of one unit must not reach another one.
  SIXPOINT_CHECK(identify());
  SIXPOINT_ASSIGN(const Bytes before, read_page());
  SIXPOINT_ASSIGN(const Bytes bytes, encode_calibration_page(page, before));
  const std::uint16_t crc = crc_ccitt(bytes);
  const auto size = static_cast<std::uint16_t>(bytes.size());
  SIXPOINT_CHECK(ask(Command::begin_write, payload_of(kCalibrationPage, size, crc)));
  const auto chunk_at = [&bytes](std::uint16_t offset) {
    return std::span<const std::uint8_t>(bytes).subspan(
        offset, std::min(kPageChunkBytes, bytes.size() - offset));
  };
  for (std::uint16_t offset = 0; offset < size;
       offset = static_cast<std::uint16_t>(offset + kPageChunkBytes)) {
    SIXPOINT_CHECK(ask(Command::write_staged, payload_of(offset, chunk_at(offset))));
  }
  for (std::uint16_t offset = 0; offset < size;
       offset = static_cast<std::uint16_t>(offset + kPageChunkBytes)) {
    const auto chunk = chunk_at(offset);
    SIXPOINT_ASSIGN(
        const Bytes staged,
        ask(Command::read_staged, payload_of(offset, static_cast<std::uint8_t>(chunk.size()))));
    if (!std::equal(chunk.begin(), chunk.end(), staged.begin(), staged.end())) {
      SIXPOINT_CHECK(ask(Command::abort_write));
      return fail(ErrorCode::io, "the unit read back other constants than were sent", link_.address,
                  "try again; the unit still holds its old constants");
    }
  }
  SIXPOINT_ASSIGN(const Bytes committed, ask(Command::commit, payload_of(crc)));
  PayloadReader reader(committed);
  if (reader.get<std::uint16_t>() != crc || !reader.ok()) {
    return fail(ErrorCode::io, "the unit committed another page than was sent", link_.address,
                "read the unit's constants before anything else");
  }
  SIXPOINT_ASSIGN(const Bytes now, read_page());
  if (now != bytes) {
    return fail(ErrorCode::io, "the unit's page is not the one that was written", link_.address,
                "read the unit's constants before anything else");
  }
  return {};
}

Result<FilterState> WireUnit::filter() {
  SIXPOINT_ASSIGN(const Bytes payload, ask(Command::get_filter));
  return decode_filter(payload);
}

Status WireUnit::set_filter(FilterConfiguration filter) {
  const std::uint8_t number = filter == FilterConfiguration::legacy ? 0 : 1;
  SIXPOINT_CHECK(ask(Command::set_filter, payload_of(number)));
  SIXPOINT_ASSIGN(const FilterState state, this->filter());
  if (state.stream != filter) {
    return fail(ErrorCode::io,
                fmt::format("the unit was told to use the filter '{}' and uses '{}'",
                            calib::to_string(filter), calib::to_string(state.stream)),
                link_.address, "update the unit's firmware");
  }
  return {};
}

Status WireUnit::start_stream(int rate_hz) {
  waiting_.clear();
  statistics_ = {};
  next_index_ = 0;
  last_block_.reset();
  rate_hz_ = rate_hz;
  streaming_ = true;
  const auto answer = ask(Command::start_stream, payload_of(static_cast<std::uint16_t>(rate_hz)));
  streaming_ = answer.has_value();
  SIXPOINT_CHECK(answer);
  return {};
}

Result<std::optional<SampleBlock>> WireUnit::next_samples(nanoseconds time_out) {
  const nanoseconds deadline = link_.clock->elapsed() + time_out;
  for (nanoseconds left = time_out; waiting_.empty() && left > nanoseconds::zero();
       left = deadline - link_.clock->elapsed()) {
    SIXPOINT_ASSIGN(const auto message, receive(left));
    if (message && message->kind == ReportKind::samples) {
      take_samples(*message);
    }
  }
  if (waiting_.empty()) {
    return std::nullopt;
  }
  std::optional<SampleBlock> block(std::move(waiting_.front()));
  waiting_.pop_front();
  return block;
}

Status WireUnit::stop_stream() {
  const auto answer = ask(Command::stop_stream);
  streaming_ = false;
  waiting_.clear();
  SIXPOINT_CHECK(answer);
  return {};
}

Result<std::uint16_t> WireUnit::ask_recording(Command command, Bytes payload) {
  SIXPOINT_ASSIGN(const Bytes answer, ask(command, std::move(payload)));
  PayloadReader reader(answer);
  const auto id = reader.get<std::uint16_t>();
  if (!reader.ok()) {
    return bad_answer("the unit did not name its recording");
  }
  return id;
}

Result<std::uint16_t> WireUnit::start_recording(int rate_hz, UtcTime now) {
  return ask_recording(Command::start_recording,
                       payload_of(static_cast<std::uint16_t>(rate_hz),
                                  static_cast<std::uint32_t>(to_unix_seconds(now))));
}

Result<std::uint16_t> WireUnit::stop_recording() {
  return ask_recording(Command::stop_recording, {});
}

Result<std::vector<RecordingInfo>> WireUnit::recordings() {
  std::vector<RecordingInfo> list;
  std::size_t count = 0;
  do {
    SIXPOINT_ASSIGN(const Bytes payload, ask(Command::list_recording,
                                             payload_of(static_cast<std::uint16_t>(list.size()))));
    SIXPOINT_ASSIGN(const RecordingEntry entry, decode_recording(payload));
    if (!list.empty() && entry.count != count) {
      return bad_answer("the unit's list of recordings changes while it is read");
    }
    count = entry.count;
    if (count != 0) {
      list.push_back(entry.info);
    }
  } while (list.size() < count);
  return list;
}

}  // namespace sixpoint::device
