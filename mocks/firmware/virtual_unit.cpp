#include "mocks/firmware/virtual_unit.h"

#include <algorithm>

#include "base/memory_env.h"
#include "base/time.h"
#include "device/wire/calibration_page.h"
#include "gt3x/recording_writer.h"
#include "sim/firmware.h"
#include "sim/recording.h"

namespace sixpoint::mocks {

namespace {

double seconds(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

// Axes of a frozen sensor repeat the first reading that is asked for.
template <class Counts, class Blocks>
void freeze(const PerAxis<bool>& frozen, std::optional<Counts>& reading, Blocks& block) {
  reading = reading.value_or(block.front());
  for (auto& counts : block) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      counts[axis] = frozen[axis] ? (*reading)[axis] : counts[axis];
    }
  }
}

}  // namespace

VirtualUnit::VirtualUnit(VirtualUnitOptions options, nanoseconds power_on)
    : options_(std::move(options)),
      memory_(device::encode_calibration_page(
                  {options_.truth.constants,
                   std::chrono::floor<std::chrono::seconds>(options_.truth.calibrated)})
                  .value_or(Bytes(device::kPageBytes, 0xFF))),
      power_on_(power_on),
      poses_(
          std::make_shared<PoseHistory>(options_.gravity_g, options_.seating_deg, options_.seed)) {
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

nanoseconds VirtualUnit::jumped_until(nanoseconds at) const {
  nanoseconds sum{0};
  for (const ClockJump& jump : clock_jumps_) {
    sum += jump.at <= at ? jump.by : nanoseconds::zero();
  }
  return sum;
}

nanoseconds VirtualUnit::device_time(nanoseconds at) const {
  nanoseconds time = at - power_on_;
  for (const ClockJump& jump : clock_jumps_) {
    time += jump.at <= at ? jump.device_time_by : nanoseconds::zero();
  }
  return time;
}

std::uint64_t VirtualUnit::device_time_us(nanoseconds at) const {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(
      0, std::chrono::floor<std::chrono::microseconds>(device_time(at)).count()));
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
  frozen_counts_.reset();
}

void VirtualUnit::jump_clock(nanoseconds jump, nanoseconds now) {
  clock_jumps_.push_back({now, jump, std::max(jump, -device_time(now))});
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
                          double tilt_deg, bool half_turned) {
  poses_->turn_to(up, seconds(now), duration_s, tilt_deg, half_turned);
}

bool VirtualUnit::is_turning(nanoseconds now) const { return poses_->is_turning(seconds(now)); }

void VirtualUnit::stop_turning(nanoseconds now) { poses_->stop(seconds(now)); }

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

// Each run has its own noise.
sim::SimulatorOptions VirtualUnit::simulator_options(int rate_hz, sim::FilterConfiguration filter,
                                                     nanoseconds start) {
  sim::SimulatorOptions options;
  options.rate_hz = rate_hz;
  options.filter = filter;
  options.start_s = seconds(start);
  options.temperature_c = options_.temperature_c;
  options.seed = options_.seed + 7919 * ++runs_;
  return options;
}

std::vector<std::unique_ptr<sim::Effect>> VirtualUnit::effects() const {
  std::vector<sim::EffectSpec> specs;
  const auto add = [&specs](std::string_view name, const PerAxis<double>& vector_deg) {
    const auto kind = sim::find_effect(name);
    if (vector_deg == PerAxis<double>{} || !kind) {
      return;
    }
    if (auto values = sim::complete_parameters(
            **kind, {{"rotation_vector_deg", {vector_deg.begin(), vector_deg.end()}}})) {
      specs.push_back({*kind, std::move(*values)});
    }
  };
  add("tilt", options_.jig_tilt_deg);
  add("misalignment", options_.misalignment_deg);
  return sim::make_effects(specs, options_.seed);
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
  if (const auto reply = replies_.take()) {
    return reply;
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
    freeze(frozen_, frozen_counts_, block.counts);
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

  sim::Simulator simulator(options_.truth,
                           simulator_options(run.rate_hz, recording_filter(), run.start), *poses_,
                           effects());
  Bytes log = sim::log_preamble(options_.truth, run.start_time, run.rate_hz);
  sim::SimulatedBlock block;
  std::optional<gt3x::Counts> frozen;
  for (std::uint64_t second = 0; second < whole_s; ++second) {
    simulator.next(rate, block);
    const nanoseconds at = run.start + std::chrono::seconds(second);
    if (frozen_ != PerAxis<bool>{} && at >= frozen_since_) {
      freeze(frozen_, frozen, block.stored);
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
  gt3x::WriterOptions how;
  how.packing = gt3x::Packing::store;  // a unit's flash holds records as they come
  auto writer = gt3x::RecordingWriter::create(files, name, how);
  Bytes image;
  if (writer && writer->add("log.bin", std::move(log)) &&
      writer->add("info.txt", sim::recording_info(options_.truth, run.start_time, end, run.rate_hz,
                                                  options_.battery_mv)
                                  .serialise()) &&
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
