// A unit in software: what its firmware does, over the simulated sensor.
//
//   mocks::VirtualUnit unit({.truth = sim::draw_unit(7, {})});
//   unit.take_report(request, now);
//   std::optional<device::Report> reply = unit.next_report(now);
//
// It answers the wire protocol (docs/protocol.md) and has no input or output of its own: a carrier
// gives it reports and the time, and takes reports and bulk blocks from it. Times are those of the
// carrier's clock (Clock::elapsed) and never go back.
//
// Samples are made on request: a unit that is not read costs nothing. One thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/env.h"
#include "device/wire/protocol.h"
#include "mocks/firmware/page_memory.h"
#include "mocks/firmware/pose_history.h"
#include "mocks/firmware/reply_queue.h"
#include "sim/simulator.h"
#include "sim/unit_truth.h"

namespace sixpoint::mocks {

using std::chrono::nanoseconds;

struct VirtualUnitOptions {
  sim::UnitTruth truth;
  std::uint64_t seed = 1;  // of noise and of seating scatter
  std::uint16_t battery_mv = 4100;
  double temperature_c = 24.5;
  double gravity_g = 1;
  // Seating scatter of every placement, standard deviation per axis: a careful person, a good jig.
  double seating_deg = 0.01;
  // The jig's base out of level, and the sensor's axes rotated in the case: rotation vectors of the
  // effects `tilt` and `misalignment` (docs/scenario.md).
  PerAxis<double> jig_tilt_deg{};
  PerAxis<double> misalignment_deg{};
  // Flash for recordings. A recording that does not fit ends where the flash is full.
  std::uint64_t flash_bytes = 64ULL << 20U;
};

class VirtualUnit {
 public:
  explicit VirtualUnit(VirtualUnitOptions options, nanoseconds power_on = nanoseconds::zero());

  // Carrier side. Any bytes may come in; bytes that are no report are dropped.
  void take_report(std::span<const std::uint8_t> report, nanoseconds now);
  std::optional<device::Report> next_report(nanoseconds now);
  std::optional<Bytes> next_bulk(nanoseconds now);
  // Number of requests to download: a new one ends the one before.
  std::uint64_t downloads() const { return downloads_; }
  // When the next report comes without a request; none where there is no stream.
  std::optional<nanoseconds> next_due() const;

  // A person or a jig turns it in `duration_s`; `tilt_deg` is the error of the final pose;
  // `half_turned` as in PoseHistory.
  void turn_to(const Eigen::Vector3d& up, nanoseconds now, double duration_s, double tilt_deg = 0,
               bool half_turned = false);
  bool is_turning(nanoseconds now) const;
  void stop_turning(nanoseconds now);  // it stays as it is at that moment

  // Power. The content of RAM is lost: stream, staged page, stored reply, filter. A recording ends.
  void cut_power(nanoseconds now);
  void restore_power(nanoseconds now);

  bool is_powered() const { return powered_; }
  // The host is gone (cable, bus reset): stream, staged page, stored reply and download end. A
  // recording goes on: the unit has a battery.
  void lose_cable();

  // Faults inside the unit (fault_plan.h).
  // The flash is full at `now`: a recording that runs ends there, and none begins.
  void fill_flash(nanoseconds now) { flash_full_since_ = now; }
  // From `now` on these axes repeat the reading that they have then.
  void freeze_sensor(const PerAxis<bool>& axes, nanoseconds now);
  // Device time and calendar jump by `jump`, which may be negative. Device time counts from 0 and is
  // unsigned: it jumps back to 0 at most, and runs on from there.
  void jump_clock(nanoseconds jump, nanoseconds now);
  // The memory is whole, but the page's own CRC does not fit its content.
  void spoil_page();

  const sim::UnitTruth& truth() const { return options_.truth; }
  PageMemory& memory() { return memory_; }
  std::uint16_t battery_mv() const { return options_.battery_mv; }
  void set_battery_mv(std::uint16_t battery_mv) { options_.battery_mv = battery_mv; }
  sim::FilterConfiguration recording_filter() const;
  // Puts a recording into the flash as if the unit had made it; configuration where it does not
  // fit.
  Status keep_recording(Bytes image, UtcTime start);
  // What each recording holds, as it would be downloaded.
  const std::vector<Bytes>& recordings() const { return images_; }

 private:
  struct Stream {
    nanoseconds start;
    int rate_hz;
    std::unique_ptr<sim::Simulator> simulator;
    std::uint16_t sequence = 0;
  };
  struct RecordingRun {
    nanoseconds start;
    int rate_hz;
    UtcTime start_time;
  };
  struct Staged {
    Bytes bytes;
    std::uint16_t crc;
  };
  struct Download {
    std::uint16_t id;
    std::uint64_t offset;
    std::uint64_t end;
  };

  struct ClockJump {
    nanoseconds at;
    nanoseconds by;              // of the calendar
    nanoseconds device_time_by;  // the same, but where that would be below 0
  };

  struct Commands;  // what it answers to each command: virtual_unit_commands.cpp
  device::Message answer(const device::Message& request, nanoseconds now);
  void answer_other_version(std::span<const std::uint8_t> report);
  sim::SimulatorOptions simulator_options(int rate_hz, sim::FilterConfiguration filter,
                                          nanoseconds start);
  std::vector<std::unique_ptr<sim::Effect>> effects() const;
  void finish_recording(nanoseconds now);
  void keep(Bytes image, UtcTime start);
  void load_page();
  std::uint64_t device_time_us(nanoseconds at) const;
  nanoseconds device_time(nanoseconds at) const;
  nanoseconds jumped_until(nanoseconds at) const;  // the calendar
  std::uint64_t flash_left() const;

  VirtualUnitOptions options_;
  PageMemory memory_;
  nanoseconds power_on_;
  bool powered_ = true;
  std::shared_ptr<PoseHistory> poses_;  // simulators of a running stream read it
  sim::FilterConfiguration stream_filter_ = sim::FilterConfiguration::current;
  std::optional<Stream> stream_;
  std::optional<RecordingRun> recording_;
  std::optional<Staged> staged_;
  std::optional<Download> download_;
  std::uint64_t downloads_ = 0;
  ReplyQueue replies_;
  std::optional<device::Message> last_request_;
  device::Report last_reply_{};
  std::vector<Bytes> images_;
  std::vector<device::RecordingInfo> infos_;
  UtcTime clock_set_to_ = from_unix_seconds(1'400'000'000);
  nanoseconds clock_set_at_{0};
  std::optional<nanoseconds> flash_full_since_;
  std::vector<ClockJump> clock_jumps_;  // since power-on
  PerAxis<bool> frozen_{};
  nanoseconds frozen_since_{0};
  std::optional<device::RawCounts> frozen_counts_;  // of the stream; its first reading
  std::uint64_t runs_ = 0;                          // streams and recordings so far
};

}  // namespace sixpoint::mocks
