#include "mocks/virtual_unit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/memory_env.h"
#include "base/random.h"
#include "device/calibration_page.h"
#include "device/payload.h"
#include "gt3x/recording_writer.h"
#include "sim/firmware.h"
#include "sim/recording.h"

namespace sixpoint::mocks {

namespace {

using device::Command;
using device::Message;
using device::PayloadReader;
using device::PayloadWriter;
using device::ReplyCode;
using device::ReportKind;

constexpr std::uint16_t kLowBattery_mv = 3300;
constexpr std::uint64_t kSeatingStream = 0x73656174;

bool rate_exists(int rate_hz) { return rate_hz >= 30 && rate_hz <= 100 && rate_hz % 10 == 0; }

double seconds(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

}  // namespace

struct VirtualUnit::Turn {
  double start_s;
  double duration_s;
  std::unique_ptr<sim::Motion> motion;
};

class VirtualUnit::Hand final : public sim::Motion {
 public:
  Hand(double gravity_g, double seating_deg, std::uint64_t seed)
      : gravity_g_(gravity_g), seating_deg_(seating_deg), random_(seed, kSeatingStream) {
    pose_ = seated(Eigen::Vector3d::UnitZ(), 0);
    turns_.push_back({-1, 0, sim::still(pose_, gravity_g_)});
  }

  void at(double time_s, sim::MotionState& state) override {
    auto turn = std::upper_bound(turns_.begin(), turns_.end(), time_s,
                                 [](double t, const Turn& later) { return t < later.start_s; });
    if (turn != turns_.begin()) {
      --turn;
    }
    turn->motion->at(time_s - turn->start_s, state);
  }

  void turn_to(const Eigen::Vector3d& up, double now_s, double duration_s, double tilt_deg) {
    sim::MotionState from;
    at(now_s, from);
    pose_ = seated(up, tilt_deg);
    turns_.push_back({now_s, duration_s,
                      sim::turn(from.rotation, pose_, duration_s, random_.bits(), gravity_g_)});
  }

  void stop(double now_s) {
    sim::MotionState state;
    at(now_s, state);
    pose_ = state.rotation;
    turns_.push_back({now_s, 0, sim::still(pose_, gravity_g_)});
  }

  bool is_turning(double now_s) const {
    return now_s < turns_.back().start_s + turns_.back().duration_s;
  }

 private:
  Eigen::Matrix3d seated(const Eigen::Vector3d& up, double tilt_deg) {
    const Eigen::Matrix3d pose = sim::rotation_with_up(up);
    const double rad = std::numbers::pi / 180;
    const Eigen::Vector3d scatter =
        seating_deg_ * rad * Eigen::Vector3d(random_.normal(), random_.normal(), 0);
    const double direction = random_.uniform(0, 2 * std::numbers::pi);
    const Eigen::Vector3d tilt =
        tilt_deg * rad * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
    const Eigen::Vector3d both = scatter + tilt;
    return both.norm() == 0
               ? pose
               : Eigen::Matrix3d(pose * Eigen::AngleAxisd(both.norm(), both.normalized()));
  }

  double gravity_g_;
  double seating_deg_;
  Random random_;
  Eigen::Matrix3d pose_ = Eigen::Matrix3d::Identity();
  std::vector<Turn> turns_;
};

VirtualUnit::VirtualUnit(VirtualUnitOptions options, nanoseconds power_on)
    : options_(std::move(options)),
      memory_(device::encode_calibration_page(
                  {options_.truth.constants,
                   std::chrono::floor<std::chrono::seconds>(options_.truth.calibrated)})
                  .value_or(Bytes(device::kPageBytes, 0xFF))),
      power_on_(power_on),
      hand_(std::make_shared<Hand>(options_.gravity_g, options_.seating_deg, options_.seed)) {
  load_page();
}

// At power-on the firmware reads its constants and chooses the filter by their date.
void VirtualUnit::load_page() {
  const auto page = memory_.read();
  const auto decoded = device::decode_calibration_page(page.value_or(Bytes{}));
  if (decoded) {
    options_.truth.constants = decoded->constants;
    options_.truth.calibrated = decoded->calibrated;
  }
  stream_filter_ = recording_filter();
}

sim::FilterConfiguration VirtualUnit::recording_filter() const {
  return sim::filter_of_recording(options_.truth.serial, options_.truth.firmware,
                                  options_.truth.calibrated);
}

double VirtualUnit::seconds_on(nanoseconds at) const { return seconds(at - power_on_); }

nanoseconds VirtualUnit::jumped_until(nanoseconds at) const {
  nanoseconds sum{0};
  for (const ClockJump& jump : clock_jumps_) {
    sum += jump.at <= at ? jump.by : nanoseconds::zero();
  }
  return sum;
}

std::uint64_t VirtualUnit::device_time_us(nanoseconds at) const {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(
      0, std::chrono::floor<std::chrono::microseconds>(at - power_on_ + jumped_until(at)).count()));
}

void VirtualUnit::lose_cable() {
  stream_.reset();
  staged_.reset();
  download_.reset();
  replies_.clear();
  last_request_.reset();
}

void VirtualUnit::freeze_sensor(const PerAxis<bool>& axes, nanoseconds now) {
  frozen_ = axes;
  frozen_since_ = now;
  frozen_counts_known_ = false;
}

void VirtualUnit::jump_clock(nanoseconds jump, nanoseconds now) {
  clock_jumps_.push_back({now, jump});
}

void VirtualUnit::spoil_page() {
  if (auto page = memory_.read()) {
    (*page)[device::kPageBytes - 1] ^= 0x5A;
    static_cast<void>(memory_.write(*page));
  }
}

std::uint64_t VirtualUnit::flash_left() const {
  std::uint64_t used = 0;
  for (const Bytes& image : images_) {
    used += image.size();
  }
  return used < options_.flash_bytes ? options_.flash_bytes - used : 0;
}

void VirtualUnit::turn_to(const Eigen::Vector3d& up, nanoseconds now, double duration_s,
                          double tilt_deg) {
  hand_->turn_to(up, seconds(now), duration_s, tilt_deg);
}

bool VirtualUnit::is_turning(nanoseconds now) const { return hand_->is_turning(seconds(now)); }

void VirtualUnit::stop_turning(nanoseconds now) { hand_->stop(seconds(now)); }

void VirtualUnit::cut_power(nanoseconds now) {
  if (recording_) {
    finish_recording(now);
  }
  powered_ = false;
  lose_cable();
}

void VirtualUnit::restore_power(nanoseconds now) {
  powered_ = true;
  power_on_ = now;
  clock_jumps_.clear();
  memory_.restore_power();
  load_page();
}

void VirtualUnit::take_report(std::span<const std::uint8_t> report, nanoseconds now) {
  if (!powered_) {
    return;
  }
  auto request = device::decode(report);
  if (!request) {
    // A whole report of another version gets an answer; everything else is noise on the cable.
    device::Report other{};
    if (report.size() == other.size() && report[0] != device::kProtocolVersion) {
      std::copy(report.begin(), report.end(), other.begin());
      const std::uint16_t crc = device::crc_ccitt(std::span(other).first(other.size() - 2));
      if (other[62] == (crc & 0xFFU) && other[63] == (crc >> 8U)) {
        replies_.push_back(device::encode({ReportKind::reply,
                                           static_cast<std::uint16_t>(other[2] | (other[3] << 8U)),
                                           static_cast<Command>(other[4]),
                                           ReplyCode::unsupported_version,
                                           {}}));
      }
    }
    return;
  }
  if (request->kind != ReportKind::request) {
    return;
  }
  if (request->sequence != 0 && last_request_ == *request) {
    replies_.push_back(last_reply_);
    return;
  }
  Message reply = answer(*request, now);
  if (!powered_) {
    return;  // the power went while it worked
  }
  reply.kind = ReportKind::reply;
  reply.sequence = request->sequence;
  reply.command = request->command;
  if (reply.code != ReplyCode::ok) {
    reply.payload.clear();
  }
  last_reply_ = device::encode(reply);
  last_request_ = std::move(*request);
  replies_.push_back(last_reply_);
}

Message VirtualUnit::answer(const Message& request, nanoseconds now) {
  PayloadReader in(request.payload);
  Message reply;
  const auto refuse = [&reply](ReplyCode code) {
    reply.code = code;
    return reply;
  };
  // Requests have exact lengths, but WRITE_STAGED.
  const auto wrong_length = [&in] { return !in.finished(); };

  switch (request.command) {
    case Command::identify: {
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      device::Identity identity;
      identity.battery_mv = options_.battery_mv;
      identity.accel_scale_lsb_per_g =
          static_cast<std::uint16_t>(std::lround(options_.truth.accel_scale_lsb_per_g));
      identity.serial = options_.truth.serial;
      identity.firmware = options_.truth.firmware;
      identity.model = options_.truth.serial.starts_with("MOS") ? "wGT3XBT" : "GT9X";
      reply.payload = device::encode_identity(identity);
      return reply;
    }
    case Command::read_page: {
      const auto page = in.get<std::uint8_t>();
      const auto offset = in.get<std::uint16_t>();
      const auto length = in.get<std::uint8_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (page != device::kCalibrationPage || length == 0 || length > device::kPageChunkBytes ||
          std::size_t{offset} + length > device::kPageBytes) {
        return refuse(ReplyCode::bad_argument);
      }
      const auto bytes = memory_.read();
      if (!bytes) {
        return refuse(ReplyCode::storage_fault);
      }
      reply.payload.assign(bytes->begin() + offset, bytes->begin() + offset + length);
      return reply;
    }
    case Command::begin_write: {
      const auto page = in.get<std::uint8_t>();
      const auto length = in.get<std::uint16_t>();
      const auto crc = in.get<std::uint16_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (page != device::kCalibrationPage || length != device::kPageBytes) {
        return refuse(ReplyCode::bad_argument);
      }
      staged_ = Staged{Bytes(length, 0xFF), crc};
      return reply;
    }
    case Command::write_staged: {
      const auto offset = in.get<std::uint16_t>();
      const auto bytes = in.take(in.left());
      if (!in.ok() || bytes.empty() || bytes.size() > device::kPageChunkBytes) {
        return refuse(ReplyCode::bad_length);
      }
      if (!staged_) {
        return refuse(ReplyCode::no_transaction);
      }
      if (offset + bytes.size() > staged_->bytes.size()) {
        return refuse(ReplyCode::bad_argument);
      }
      std::copy(bytes.begin(), bytes.end(), staged_->bytes.begin() + offset);
      return reply;
    }
    case Command::read_staged: {
      const auto offset = in.get<std::uint16_t>();
      const auto length = in.get<std::uint8_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (!staged_) {
        return refuse(ReplyCode::no_transaction);
      }
      if (length == 0 || length > device::kPageChunkBytes ||
          std::size_t{offset} + length > staged_->bytes.size()) {
        return refuse(ReplyCode::bad_argument);
      }
      reply.payload.assign(staged_->bytes.begin() + offset,
                           staged_->bytes.begin() + offset + length);
      return reply;
    }
    case Command::commit: {
      const auto crc = in.get<std::uint16_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      return refuse(commit(crc, reply.payload, now));
    }
    case Command::abort_write:
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      staged_.reset();
      return reply;
    case Command::get_filter:
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      reply.payload = device::encode_filter({stream_filter_, recording_filter()});
      return reply;
    case Command::set_filter: {
      const auto filter = in.get<std::uint8_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (filter > 1) {
        return refuse(ReplyCode::bad_argument);
      }
      if (stream_) {
        return refuse(ReplyCode::busy);
      }
      stream_filter_ =
          filter == 0 ? sim::FilterConfiguration::legacy : sim::FilterConfiguration::current;
      return reply;
    }
    case Command::start_stream: {
      const auto rate_hz = in.get<std::uint16_t>();
      return refuse(wrong_length() ? ReplyCode::bad_length : start_stream(rate_hz, now));
    }
    case Command::stop_stream: {
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      const std::uint64_t samples = stream_ ? stream_->simulator->samples() : 0;
      stream_.reset();
      reply.payload = PayloadWriter().put(static_cast<std::uint32_t>(samples)).take();
      return reply;
    }
    case Command::start_recording: {
      const auto rate_hz = in.get<std::uint16_t>();
      const auto unix_time = in.get<std::uint32_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (recording_ || stream_) {
        return refuse(ReplyCode::busy);
      }
      if (!rate_exists(rate_hz)) {
        return refuse(ReplyCode::bad_argument);
      }
      if (options_.battery_mv < kLowBattery_mv) {
        return refuse(ReplyCode::battery_low);
      }
      if (flash_full_since_ || flash_left() < (64U << 10U)) {
        return refuse(ReplyCode::storage_full);
      }
      clock_set_to_ = from_unix_seconds(unix_time);
      clock_set_at_ = now;
      recording_ = RecordingRun{now, rate_hz, clock_set_to_};
      reply.payload = PayloadWriter().put(static_cast<std::uint16_t>(images_.size() + 1)).take();
      return reply;
    }
    case Command::stop_recording:
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (!recording_) {
        return refuse(ReplyCode::no_such_recording);
      }
      finish_recording(now);
      reply.payload = PayloadWriter().put(static_cast<std::uint16_t>(images_.size())).take();
      return reply;
    case Command::list_recording: {
      const auto index = in.get<std::uint16_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      device::RecordingEntry entry;
      entry.count = static_cast<std::uint16_t>(infos_.size());
      if (entry.count != 0 || index != 0) {
        if (index >= infos_.size()) {
          return refuse(ReplyCode::no_such_recording);
        }
        entry.info = infos_[index];
      }
      reply.payload = device::encode_recording(entry);
      return reply;
    }
    case Command::download: {
      const auto id = in.get<std::uint16_t>();
      const auto offset = in.get<std::uint64_t>();
      const auto length = in.get<std::uint32_t>();
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      if (recording_) {
        return refuse(ReplyCode::busy);
      }
      if (id == 0 || id > images_.size()) {
        return refuse(ReplyCode::no_such_recording);
      }
      const std::uint64_t size = images_[id - 1U].size();
      if (offset > size) {
        return refuse(ReplyCode::bad_argument);
      }
      const std::uint64_t promised = std::min<std::uint64_t>(length, size - offset);
      ++downloads_;
      download_ = Download{id, offset, offset + promised};
      reply.payload = PayloadWriter().put(promised).take();
      return reply;
    }
    case Command::get_time: {
      if (wrong_length()) {
        return refuse(ReplyCode::bad_length);
      }
      const UtcTime calendar =
          clock_set_to_ + (now - clock_set_at_) + (jumped_until(now) - jumped_until(clock_set_at_));
      reply.payload = PayloadWriter()
                          .put(device_time_us(now))
                          .put(static_cast<std::uint32_t>(to_unix_seconds(calendar)))
                          .take();
      return reply;
    }
    case Command::none:
      break;
  }
  return refuse(ReplyCode::unknown_command);
}

ReplyCode VirtualUnit::commit(std::uint16_t crc, Bytes& payload, nanoseconds now) {
  if (!staged_) {
    return ReplyCode::no_transaction;
  }
  if (recording_) {
    return ReplyCode::busy;
  }
  if (options_.battery_mv < kLowBattery_mv) {
    return ReplyCode::battery_low;
  }
  if (crc != staged_->crc || crc != device::crc_ccitt(staged_->bytes)) {
    return ReplyCode::crc_mismatch;
  }
  if (!memory_.write(staged_->bytes)) {
    if (!memory_.has_power()) {
      cut_power(now);
    }
    return ReplyCode::storage_fault;
  }
  staged_.reset();
  const sim::FilterConfiguration filter = stream_filter_;
  load_page();
  stream_filter_ = filter;  // SET_FILTER holds until power-off
  const auto page = memory_.read();
  payload = PayloadWriter().put(device::crc_ccitt(page.value_or(Bytes{}))).take();
  return ReplyCode::ok;
}

ReplyCode VirtualUnit::start_stream(int rate_hz, nanoseconds now) {
  if (recording_) {
    return ReplyCode::busy;
  }
  if (!rate_exists(rate_hz)) {
    return ReplyCode::bad_argument;
  }
  sim::SimulatorOptions options;
  options.rate_hz = rate_hz;
  options.filter = stream_filter_;
  options.start_s = seconds(now);
  options.temperature_c = options_.temperature_c;
  options.seed = options_.seed + 7919 * ++runs_;
  stream_ = Stream{now, rate_hz, std::make_unique<sim::Simulator>(options_.truth, options, *hand_)};
  return ReplyCode::ok;
}

std::optional<nanoseconds> VirtualUnit::next_due() const {
  if (!powered_ || !stream_) {
    return std::nullopt;
  }
  // A report is due when its last sample was taken.
  return stream_->start +
         from_seconds(
             static_cast<double>(stream_->simulator->samples() + device::kSamplesPerReport - 1) /
             stream_->rate_hz) +
         nanoseconds(1);
}

std::optional<device::Report> VirtualUnit::next_report(nanoseconds now) {
  if (!replies_.empty()) {
    const device::Report report = replies_.front();
    replies_.pop_front();
    return report;
  }
  const auto due = next_due();
  if (!due || *due > now) {
    return std::nullopt;
  }
  const std::uint64_t first = stream_->simulator->samples();
  sim::SimulatedBlock simulated;
  stream_->simulator->next(device::kSamplesPerReport, simulated);
  device::SampleBlock block;
  block.sequence = stream_->sequence++;
  block.first_index = static_cast<std::uint32_t>(first);
  block.device_time_us =
      device_time_us(stream_->start + from_seconds(static_cast<double>(first) / stream_->rate_hz));
  block.temperature_c = simulated.temperature_c.front();
  block.filter = stream_filter_;
  for (const auto& raw : simulated.raw_lsb) {
    block.counts.push_back({static_cast<std::int16_t>(raw[0]), static_cast<std::int16_t>(raw[1]),
                            static_cast<std::int16_t>(raw[2])});
  }
  if (frozen_ != PerAxis<bool>{} && *due >= frozen_since_) {
    if (!frozen_counts_known_) {
      frozen_counts_ = block.counts.front();
      frozen_counts_known_ = true;
    }
    for (device::RawCounts& counts : block.counts) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        counts[axis] = frozen_[axis] ? frozen_counts_[axis] : counts[axis];
      }
    }
  }
  return device::encode(device::encode_samples(block));
}

std::optional<Bytes> VirtualUnit::next_bulk(nanoseconds /*now*/) {
  if (!powered_ || !download_ || download_->offset >= download_->end) {
    return std::nullopt;
  }
  const Bytes& image = images_[download_->id - 1U];
  const std::uint64_t length =
      std::min<std::uint64_t>(device::kBulkContentBytes, download_->end - download_->offset);
  device::BulkBlock block;
  block.recording = download_->id;
  block.offset = download_->offset;
  block.content = std::span(image).subspan(download_->offset, length);
  download_->offset += length;
  block.last = download_->offset == download_->end;
  return device::encode_bulk(block);
}

void VirtualUnit::finish_recording(nanoseconds now) {
  const RecordingRun run = *recording_;
  recording_.reset();
  const auto rate = static_cast<std::size_t>(run.rate_hz);
  const std::uint64_t bytes_per_s = 9 + (rate * 36 + 7) / 8;
  constexpr std::uint64_t kArchiveOverhead = 4096;
  const std::uint64_t room = flash_left();
  const nanoseconds end_of_room = std::min(now, flash_full_since_.value_or(now));
  const auto lasted_s = static_cast<std::uint64_t>(std::max(0.0, seconds(end_of_room - run.start)));
  const std::uint64_t whole_s =
      std::min(lasted_s, room > kArchiveOverhead ? (room - kArchiveOverhead) / bytes_per_s : 0);

  sim::SimulatorOptions options;
  options.rate_hz = run.rate_hz;
  options.filter = recording_filter();
  options.start_s = seconds(run.start);
  options.temperature_c = options_.temperature_c;
  options.seed = options_.seed + 7919 * ++runs_;
  sim::Simulator simulator(options_.truth, options, *hand_);
  Bytes log = sim::log_preamble(options_.truth, run.start_time, run.rate_hz);
  sim::SimulatedBlock block;
  std::optional<gt3x::Counts> frozen;
  for (std::uint64_t second = 0; second < whole_s; ++second) {
    simulator.next(rate, block);
    const nanoseconds at = run.start + std::chrono::seconds(second);
    if (frozen_ != PerAxis<bool>{} && at >= frozen_since_) {
      frozen = frozen.value_or(block.stored.front());
      for (gt3x::Counts& counts : block.stored) {
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
          counts[axis] = frozen_[axis] ? (*frozen)[axis] : counts[axis];
        }
      }
    }
    const auto jumped =
        std::chrono::floor<std::chrono::seconds>(jumped_until(at) - jumped_until(run.start));
    sim::append_second(log, run.start_time + std::chrono::seconds(second) + jumped, block.stored,
                       false);
  }
  const UtcTime end = run.start_time + std::chrono::seconds(whole_s);

  // The archive is made on a disk in memory: the model has none of its own.
  MemoryFiles files;
  const std::string name = "recording.gt3x";
  auto writer = gt3x::RecordingWriter::create(files, name);
  Bytes image;
  if (writer && writer->add("log.bin", std::move(log)) &&
      writer->add(
          "info.txt",
          sim::recording_info(options_.truth, run.start_time, end, run.rate_hz).serialise()) &&
      writer->commit()) {
    image = read_file(files, name, options_.flash_bytes * 2).value_or(Bytes{});
  }
  keep(std::move(image), run.start_time);
}

Status VirtualUnit::keep_recording(Bytes image, UtcTime start) {
  if (image.size() > flash_left()) {
    return fail(ErrorCode::configuration, "the recording does not fit into the unit's flash",
                options_.truth.serial, "make the scenario shorter");
  }
  keep(std::move(image), start);
  return {};
}

void VirtualUnit::keep(Bytes image, UtcTime start) {
  device::RecordingInfo info;
  info.id = static_cast<std::uint16_t>(images_.size() + 1);
  info.bytes = image.size();
  info.start_unix_time = static_cast<std::uint32_t>(to_unix_seconds(start));
  info.sha256 = sha256(image);
  images_.push_back(std::move(image));
  infos_.push_back(info);
}

}  // namespace sixpoint::mocks
