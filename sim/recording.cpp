#include "sim/recording.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gt3x/forms/model.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/log/record.h"
#include "gt3x/recording_writer.h"
#include "sim/simulator.h"

namespace sixpoint::sim {

namespace {

std::uint32_t unix_time(UtcTime time) { return static_cast<std::uint32_t>(to_unix_seconds(time)); }

void append_text(Bytes& log, UtcTime time, std::string_view json) {
  gt3x::append_record(log, gt3x::RecordType::metadata, unix_time(time),
                      std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
}

// A stable number of the unit for the identifiers that real files hold.
std::uint32_t unit_number(const UnitTruth& unit) {
  std::uint32_t hash = 2166136261U;
  for (const char c : unit.serial) {
    hash = (hash ^ static_cast<std::uint8_t>(c)) * 16777619U;
  }
  return hash;
}

// log.bin, made while it is read.
class ScenarioLog final : public gt3x::ByteSource {
 public:
  ScenarioLog(const Scenario& scenario, std::uint64_t seconds, RecordingReport& report,
              const TruthSink& truth)
      : scenario_(scenario),
        seconds_(seconds),
        report_(report),
        truth_(truth),
        motion_(scenario.motion()),
        simulator_(scenario.unit, options_of(scenario), *motion_,
                   make_effects(scenario.effects, scenario.seed)),
        pending_(log_preamble(scenario.unit, scenario.start, scenario.rate_hz)) {}

  Status problem() const { return simulator_.problem(); }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (at_ == pending_.size() && second_ < seconds_) {
      pending_.clear();
      at_ = 0;
      SIXPOINT_CHECK(make_second());
    }
    const std::size_t count = std::min(out.size(), pending_.size() - at_);
    std::copy_n(pending_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
    at_ += count;
    return count;
  }

 private:
  static SimulatorOptions options_of(const Scenario& scenario) {
    SimulatorOptions options;
    options.rate_hz = scenario.rate_hz;
    options.filter = scenario.filter_in_force();
    options.stored_bits = scenario.wide ? 16 : 12;
    options.temperature_c = scenario.temperature_c;
    options.seed = scenario.seed;
    options.plan = scenario.plan();
    options.placements = scenario.placements();
    return options;
  }

  Status make_second() {
    constexpr std::uint64_t kBatteryEvery_s = 3600;
    const UtcTime time = scenario_.start + std::chrono::seconds(second_);
    if (second_ % kBatteryEvery_s == 0) {
      const auto millivolts = static_cast<std::uint16_t>(
          4170 - std::min<std::uint64_t>(700, second_ / kBatteryEvery_s));
      const std::array<std::uint8_t, 2> payload = {static_cast<std::uint8_t>(millivolts & 0xFFU),
                                                   static_cast<std::uint8_t>(millivolts >> 8U)};
      gt3x::append_record(pending_, gt3x::RecordType::battery, unix_time(time), payload);
    }
    simulator_.next(static_cast<std::size_t>(scenario_.rate_hz), block_);
    append_second(pending_, time, block_.stored, scenario_.wide);
    ++second_;
    report_.samples = simulator_.samples();
    report_.clipped_samples = simulator_.clipped();
    return truth_ ? truth_(time, block_.true_g) : Status{};
  }

  const Scenario& scenario_;
  std::uint64_t seconds_;
  RecordingReport& report_;
  const TruthSink& truth_;
  std::unique_ptr<MotionSequence> motion_;
  Simulator simulator_;
  SimulatedBlock block_;
  Bytes pending_;
  std::size_t at_ = 0;
  std::uint64_t second_ = 0;
};

}  // namespace

Bytes log_preamble(const UnitTruth& unit, UtcTime start, int rate_hz) {
  const UtcTime initialised = start - std::chrono::seconds(70);
  Bytes log;
  append_text(log, initialised,
              R"({"MetadataType":"Bio","SubjectName":"simulated","Height":172.72,"Weight":61.23,)"
              R"("Race":"","Limb":"","Side":"","Dominance":"","Parsed":false,"JSON":null})");
  append_text(log, initialised,
              R"({"MetadataType":"InitOwner","System":"Sixpoint","Parsed":true,"JSON":null})");

  // Identifiers beyond the named ones: the values of a real wGT3X-BT file.
  gt3x::ParameterValues values = {
      {{0, 7}, 54'722'035},
      {{0, 8}, 1},
      {{0, 16}, 1'920'991'232},
      {{0, 26}, 2},
      {{0, 28}, 317},
      {{0, 29}, 7},
      {{0, 32}, 16'842'752},
      {{0, 37}, 1282},
      {{1, 0}, 1},
      {{1, 1}, unit_number(unit)},
      {{1, 2}, 261},
      {{1, 3}, 4},
      {{1, 45}, 122'748'928},
  };
  using Key = gt3x::ParameterKey;
  for (const Key& zero : {Key(0, 6), Key(0, 20), Key(0, 21), Key(0, 22), Key(0, 23), Key(0, 38),
                          Key(1, 13), Key(1, 20), Key(1, 21), Key(1, 33), Key(1, 40), Key(1, 46)}) {
    values[zero] = 0;
  }
  values[gt3x::kParameterCalibrationTime] = unix_time(unit.calibrated);
  values[gt3x::kParameterFirmwareVersion] = gt3x::encode_firmware(unit.firmware).value_or(0);
  values[gt3x::kParameterAccelScale] = gt3x::encode_float(unit.accel_scale_lsb_per_g);
  values[gt3x::kParameterSampleRate] = static_cast<std::uint32_t>(rate_hz);
  values[{1, 12}] = unix_time(start);
  values[{1, 14}] = unix_time(initialised);
  gt3x::set_constants(values, unit.constants);
  gt3x::append_record(log, gt3x::RecordType::parameters, unix_time(initialised),
                      gt3x::encode_parameters(values));
  return log;
}

void append_second(Bytes& log, UtcTime time, std::span<const gt3x::Counts> samples, bool wide) {
  Bytes payload;
  if (wide) {
    gt3x::append_activity2(payload, samples);
  } else {
    gt3x::append_activity(payload, samples);
  }
  gt3x::append_record(log, wide ? gt3x::RecordType::activity2 : gt3x::RecordType::activity,
                      unix_time(time), payload);
}

std::string_view device_type_of(std::string_view serial) {
  return gt3x::model_of(serial) == "GT9X Link" ? "Link" : "wGT3XBT";
}

gt3x::Info recording_info(const UnitTruth& unit, UtcTime start, UtcTime end, int rate_hz,
                          int battery_mv) {
  gt3x::Info info;
  const auto ticks = [](UtcTime time) { return std::to_string(gt3x::to_ticks(time)); };
  info.set("Serial Number", unit.serial);
  info.set("Device Type", std::string(device_type_of(unit.serial)));
  info.set("Firmware", unit.firmware);
  info.set("Battery Voltage", fmt::format("{:.2f}", battery_mv / 1000.0));
  info.set("Sample Rate", std::to_string(rate_hz));
  info.set("Start Date", ticks(start));
  info.set("Stop Date", "0");
  info.set("Last Sample Time", ticks(end));
  info.set("TimeZone", "00:00:00");
  info.set("Download Date", ticks(end));
  info.set("Board Revision", "1");
  info.set("Unexpected Resets", "0");
  info.set("Acceleration Scale", fmt::format("{:.1f}", unit.accel_scale_lsb_per_g));
  info.set("Acceleration Min", "-8.0");
  info.set("Acceleration Max", "8.0");
  info.set("Subject Name", "simulated");
  return info;
}

Result<RecordingReport> write_recording(FileSystem& files, const std::string& path,
                                        const Scenario& scenario, const TruthSink& truth) {
  const auto seconds = static_cast<std::uint64_t>(std::floor(scenario.motion()->duration_s()));
  RecordingReport report;
  report.duration_s = static_cast<double>(seconds);
  ScenarioLog log(scenario, seconds, report, truth);
  SIXPOINT_CHECK(log.problem());
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, path));
  SIXPOINT_CHECK(writer.add("log.bin", log));
  SIXPOINT_CHECK(writer.add(
      "info.txt", recording_info(scenario.unit, scenario.start,
                                 scenario.start + std::chrono::seconds(seconds), scenario.rate_hz)
                      .serialise()));
  SIXPOINT_CHECK(writer.commit());
  return report;
}

}  // namespace sixpoint::sim
