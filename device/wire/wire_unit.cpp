#include "device/wire_unit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "device/payload.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;

tl::unexpected<Error> refused(const std::string& where, Command command, ReplyCode code) {
  std::string hint = "update the unit's firmware or this program";
  switch (code) {
    case ReplyCode::busy:
      hint = "stop the recording or the stream first";
      break;
    case ReplyCode::battery_low:
      hint = "charge the unit";
      break;
    case ReplyCode::storage_full:
      hint = "download and clear the unit's recordings";
      break;
    case ReplyCode::no_such_recording:
      hint = "list the unit's recordings again";
      break;
    case ReplyCode::crc_mismatch:
    case ReplyCode::no_transaction:
      hint = "try again; the unit still holds what it held";
      break;
    case ReplyCode::storage_fault:
      hint = "try again; if it stays, the unit's memory is worn out";
      break;
    default:
      break;
  }
  return fail(ErrorCode::io,
              fmt::format("the unit refused '{}': {}", to_string(command), to_string(code)), where,
              std::move(hint));
}

tl::unexpected<Error> nonsense(const std::string& where, std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), where,
              "plug the unit in again; if it stays, the unit or its firmware is faulty");
}

tl::unexpected<Error> swapped(const std::string& where, const std::string& was,
                              const std::string& is) {
  return fail(ErrorCode::device_unavailable, fmt::format("the unit was {} and is now {}", was, is),
              where, "put the first unit back, or begin anew with this one");
}

}  // namespace

Result<std::unique_ptr<Unit>> Unit::open(Link link, UnitOptions options) {
  return WireUnit::open(std::move(link), options);
}

Result<std::unique_ptr<Unit>> WireUnit::open(Link link, UnitOptions options) {
  std::unique_ptr<WireUnit> unit(new WireUnit(std::move(link), options));
  SIXPOINT_CHECK(unit->introduce({}));
  return std::unique_ptr<Unit>(std::move(unit));
}

Status WireUnit::introduce(const std::string& expected) {
  SIXPOINT_ASSIGN(const Bytes payload, ask(Command::identify, {}, true));
  SIXPOINT_ASSIGN(const Identity identity, decode_identity(payload));
  if (!link_.serial.empty() && link_.serial != identity.serial) {
    return nonsense(link_.address,
                    fmt::format("the unit is {} by its USB descriptor and {} by its own word",
                                printable(link_.serial, 80), identity.serial));
  }
  identity_is_another_ = !expected.empty() && identity.serial != expected;
  if (identity_is_another_) {
    return swapped(link_.address, expected, identity.serial);
  }
  identity_ = identity;
  return {};
}

Status WireUnit::reconnect(nanoseconds patience) {
  const nanoseconds deadline = link_.clock->elapsed() + patience;
  const std::string serial = identity_.serial;
  streaming_ = false;
  // Perhaps it only started anew, and the cable is as it was.
  Status answer = introduce(serial);
  std::string hint = "plug it in again and begin anew";
  while (!answer && !identity_is_another_ && link_.reopen && !cancelled_) {
    if (link_.clock->elapsed() >= deadline) {
      return fail(ErrorCode::device_unavailable,
                  fmt::format("the unit {} went away and did not come back within {:.0f} s", serial,
                              std::chrono::duration<double>(patience).count()),
                  link_.address, hint);
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
  SIXPOINT_ASSIGN(Identity identity, decode_identity(payload));
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
  // One byte more than a report, so that a longer one is seen to be too long.
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
    // they do not is a damaged one, however well its CRC fits.
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
    // Crystals are off by 0.01 %, resonators by 2; what is more is no drift.
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
          return refused(link_.address, command, message->code);
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
    const auto length =
        static_cast<std::uint8_t>(std::min(kPageChunkBytes, kPageBytes - page.size()));
    SIXPOINT_ASSIGN(const Bytes chunk,
                    ask(Command::read_page, PayloadWriter()
                                                .put(kCalibrationPage)
                                                .put(static_cast<std::uint16_t>(page.size()))
                                                .put(length)
                                                .take()));
    if (chunk.size() != length) {
      return nonsense(link_.address, "a part of the calibration page has the wrong length");
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
  // Constants of one unit in another would be the worst that can happen here.
  SIXPOINT_CHECK(identify());
  SIXPOINT_ASSIGN(const Bytes before, read_page());
  SIXPOINT_ASSIGN(const Bytes bytes, encode_calibration_page(page, before));
  const std::uint16_t crc = crc_ccitt(bytes);
  SIXPOINT_CHECK(ask(Command::begin_write, PayloadWriter()
                                               .put(kCalibrationPage)
                                               .put(static_cast<std::uint16_t>(bytes.size()))
                                               .put(crc)
                                               .take()));
  for (std::size_t offset = 0; offset < bytes.size(); offset += kPageChunkBytes) {
    const auto chunk =
        std::span(bytes).subspan(offset, std::min(kPageChunkBytes, bytes.size() - offset));
    SIXPOINT_CHECK(ask(Command::write_staged,
                       PayloadWriter().put(static_cast<std::uint16_t>(offset)).put(chunk).take()));
  }
  for (std::size_t offset = 0; offset < bytes.size(); offset += kPageChunkBytes) {
    const auto chunk =
        std::span(bytes).subspan(offset, std::min(kPageChunkBytes, bytes.size() - offset));
    SIXPOINT_ASSIGN(const Bytes staged,
                    ask(Command::read_staged, PayloadWriter()
                                                  .put(static_cast<std::uint16_t>(offset))
                                                  .put(static_cast<std::uint8_t>(chunk.size()))
                                                  .take()));
    if (!std::equal(chunk.begin(), chunk.end(), staged.begin(), staged.end())) {
      SIXPOINT_CHECK(ask(Command::abort_write));
      return fail(ErrorCode::io, "the unit read back other constants than were sent", link_.address,
                  "try again; the unit still holds its old constants");
    }
  }
  SIXPOINT_ASSIGN(const Bytes committed, ask(Command::commit, PayloadWriter().put(crc).take()));
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
  SIXPOINT_CHECK(ask(Command::set_filter, PayloadWriter()
                                              .put(static_cast<std::uint8_t>(
                                                  filter == FilterConfiguration::legacy ? 0 : 1))
                                              .take()));
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
  const auto answer =
      ask(Command::start_stream, PayloadWriter().put(static_cast<std::uint16_t>(rate_hz)).take());
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

Result<std::uint16_t> WireUnit::start_recording(int rate_hz, UtcTime now) {
  SIXPOINT_ASSIGN(
      const Bytes payload,
      ask(Command::start_recording, PayloadWriter()
                                        .put(static_cast<std::uint16_t>(rate_hz))
                                        .put(static_cast<std::uint32_t>(to_unix_seconds(now)))
                                        .take()));
  PayloadReader reader(payload);
  const auto id = reader.get<std::uint16_t>();
  if (!reader.ok()) {
    return nonsense(link_.address, "the unit did not name its recording");
  }
  return id;
}

Result<std::uint16_t> WireUnit::stop_recording() {
  SIXPOINT_ASSIGN(const Bytes payload, ask(Command::stop_recording));
  PayloadReader reader(payload);
  const auto id = reader.get<std::uint16_t>();
  if (!reader.ok()) {
    return nonsense(link_.address, "the unit did not name its recording");
  }
  return id;
}

Result<std::vector<RecordingInfo>> WireUnit::recordings() {
  std::vector<RecordingInfo> list;
  std::size_t count = 0;
  do {
    SIXPOINT_ASSIGN(const Bytes payload,
                    ask(Command::list_recording,
                        PayloadWriter().put(static_cast<std::uint16_t>(list.size())).take()));
    SIXPOINT_ASSIGN(const RecordingEntry entry, decode_recording(payload));
    if (!list.empty() && entry.count != count) {
      return nonsense(link_.address, "the unit's list of recordings changes while it is read");
    }
    count = entry.count;
    if (count != 0) {
      list.push_back(entry.info);
    }
  } while (list.size() < count);
  return list;
}

Status WireUnit::download_from(const RecordingInfo& recording, std::uint64_t& offset,
                               WritableFile& file, Sha256& hash,
                               const std::function<void(std::uint64_t)>& progress) {
  constexpr std::uint64_t kPerRequest = 64ULL << 20U;
  // An ended request leaves blocks in the pipe, and in the transfers that a carrier keeps under
  // way: so many are dropped before the first block of the new one must have come.
  constexpr int kStaleBlocks = 64;
  std::vector<std::uint8_t> buffer(kBulkBlockBytes + 1);
  int without_progress = 0;
  while (offset < recording.bytes) {
    const std::uint64_t length = std::min(kPerRequest, recording.bytes - offset);
    const std::uint64_t end = offset + length;
    const std::uint64_t begin = offset;
    SIXPOINT_ASSIGN(const Bytes payload,
                    ask(Command::download, PayloadWriter()
                                               .put(recording.id)
                                               .put(offset)
                                               .put(static_cast<std::uint32_t>(length))
                                               .take()));
    PayloadReader reader(payload);
    if (reader.get<std::uint64_t>() != length || !reader.ok()) {
      return nonsense(link_.address, "the unit offers another length than its list says");
    }
    int stale = 0;
    while (offset < end) {
      const Result<std::size_t> count = link_.bulk->read(buffer, options_.bulk_time_out);
      if (!count && count.error().code != ErrorCode::io) {
        return fail(count.error());
      }
      if (!count || *count == 0) {
        break;  // a failed transfer or none: ask again from here
      }
      const Result<BulkBlock> block =
          decode_bulk(std::span(buffer).first(std::min(*count, buffer.size())));
      if (!block || block->recording != recording.id || block->offset != offset ||
          block->content.size() > end - offset) {
        if (offset == begin && ++stale <= kStaleBlocks) {
          continue;
        }
        break;
      }
      SIXPOINT_CHECK(file.write_at(offset, block->content));
      hash.update(block->content);
      offset += block->content.size();
      if (progress) {
        progress(offset);
      }
    }
    without_progress = offset > begin ? 0 : without_progress + 1;
    if (without_progress >= options_.download_attempts) {
      return fail(ErrorCode::device_unavailable,
                  fmt::format("the download stopped at byte {} of {}", offset, recording.bytes),
                  link_.address, "plug the unit in again and repeat: what came is kept");
    }
  }
  return {};
}

Status WireUnit::download(const RecordingInfo& recording, FileSystem& files,
                          const std::string& path,
                          const std::function<void(std::uint64_t)>& progress) {
  if (!link_.bulk) {
    return fail(ErrorCode::device_unavailable, "this device offers no download", link_.address,
                "connect the unit by USB");
  }
  if (files.info(path)) {
    return fail(ErrorCode::cannot_create, "the file exists already", path,
                "choose another name or remove it");
  }
  const std::string part = fmt::format("{}.{}.part", path, to_hex(recording.sha256).substr(0, 12));
  const std::string before = part + ".before";

  // A part from an earlier call moves aside and is copied, so that a loss of power now costs
  // nothing either.
  if (files.info(part)) {
    SIXPOINT_CHECK(files.rename(part, before));
  }
  SIXPOINT_ASSIGN(auto file, files.create(part));
  Sha256 hash;
  std::uint64_t offset = 0;
  if (const auto earlier = files.open(before); earlier) {
    Bytes chunk(kBulkContentBytes);
    while (offset < recording.bytes) {
      const std::uint64_t wanted = std::min<std::uint64_t>(chunk.size(), recording.bytes - offset);
      SIXPOINT_ASSIGN(const std::size_t count,
                      (*earlier)->read_at(offset, std::span(chunk).first(wanted)));
      if (count == 0) {
        break;
      }
      const auto bytes = std::span(chunk).first(count);
      SIXPOINT_CHECK(file->write_at(offset, bytes));
      hash.update(bytes);
      offset += count;
    }
  }
  const Status came = download_from(recording, offset, *file, hash, progress);
  SIXPOINT_CHECK(file->sync());
  SIXPOINT_CHECK(file->close());
  SIXPOINT_CHECK(files.sync_folder(folder_of(path)));
  if (files.info(before)) {
    SIXPOINT_CHECK(files.remove(before));
  }
  SIXPOINT_CHECK(came);
  if (hash.finish() != recording.sha256) {
    SIXPOINT_CHECK(files.remove(part));
    return fail(ErrorCode::bad_data, "what came is not the recording that the unit announced",
                link_.address, "download it again");
  }
  SIXPOINT_CHECK(files.rename(part, path));
  return files.sync_folder(folder_of(path));
}

}  // namespace sixpoint::device
