#include "sim/bundle_writer.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/random.h"
#include "gt3x/forms/model.h"
#include "gt3x/recording_writer.h"
#include "sim/recording.h"

namespace sixpoint::sim {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kClockStream = 0x636C6F63;
constexpr std::uint64_t kLogStream = 0x74656D70;
constexpr double kHostClock_s = 0.002;
constexpr double kLogNoise_c = 0.1;

double rounded(double value, double steps_per_unit) {
  return std::round(value * steps_per_unit) / steps_per_unit;
}

std::string protocol_text(const Scenario& scenario, const ProtocolRun& run,
                          const ProtocolRecord& record) {
  Json head;
  head["schema"] = "sixpoint/bundle/1";
  head["sample_rate_hz"] = scenario.rate_hz;
  if (run.accel_scale_lsb_per_g == std::floor(run.accel_scale_lsb_per_g)) {
    head["accel_scale_lsb_per_g"] = static_cast<std::int64_t>(run.accel_scale_lsb_per_g);
  } else {
    head["accel_scale_lsb_per_g"] = run.accel_scale_lsb_per_g;
  }
  head["gravity_g"] = run.gravity_g;
  head["unit"] = {{"serial", scenario.unit.serial},
                  {"model", gt3x::model_of(scenario.unit.serial)},
                  {"firmware", scenario.unit.firmware}};
  // One segment a line, so that people can read it.
  std::string text = head.dump();
  text.pop_back();
  text += ",\"segments\":[\n";
  for (std::size_t i = 0; i < run.segments.size(); ++i) {
    const ProtocolSegment& segment = run.segments[i];
    Json line;
    line["name"] = segment.name;
    line["kind"] = to_string(segment.kind);
    line["first_sample"] = segment.first_sample;
    line["samples"] = segment.samples;
    line["host_start_s"] = rounded(record.host_start_s[i], 1e4);
    line["rotation"] = Json::array();
    for (Eigen::Index row = 0; row < 3; ++row) {
      Json numbers = Json::array();
      for (Eigen::Index column = 0; column < 3; ++column) {
        numbers.push_back(rounded(segment.rotation(row, column), 1e12) + 0.0);
      }
      line["rotation"].push_back(numbers);
    }
    if (segment.kind == SegmentKind::ramp) {
      line["temperature_c"] = segment.commanded_c;
    } else {
      line["temperature_c"] = segment.commanded_c[0];
    }
    if (segment.vibration) {
      const Tone& tone = *segment.vibration;
      line["vibration"] = {
          {"direction_lab",
           {tone.direction_lab.x(), tone.direction_lab.y(), tone.direction_lab.z()}},
          {"frequency_hz", tone.frequency_hz},
          {"amplitude_g", tone.amplitude_g}};
    }
    text += line.dump();
    text += i + 1 < run.segments.size() ? ",\n" : "\n";
  }
  return text + "]}\n";
}

std::string temperature_text(const ProtocolRun& run, std::uint64_t seed) {
  Random random(seed, kLogStream);
  std::string text = "host_time_s,temperature_c\n";
  for (const TemperaturePoint& point : run.temperature) {
    fmt::format_to(std::back_inserter(text), "{:.2f},{:.2f}\n",
                   std::max(0.0, point.host_time_s + random.uniform(-0.02, 0.02)),
                   point.temperature_c + kLogNoise_c * random.normal());
  }
  return text;
}

std::string clock_text(const ProtocolRun& run, const ProtocolRecord& record, std::size_t packet,
                       std::uint64_t seed) {
  Random random(seed, kClockStream);
  std::string text = "sample_index,host_time_s\n";
  for (const ProtocolSegment& segment : run.segments) {
    for (std::uint64_t i = segment.first_sample; i < segment.first_sample + segment.samples;
         i += packet) {
      fmt::format_to(std::back_inserter(text), "{},{:.4f}\n", i,
                     record.sample_time_s[i] + random.uniform(-kHostClock_s, kHostClock_s));
    }
  }
  return text;
}

}  // namespace

Result<BundleReport> write_bundle(FileSystem& files, const std::string& folder,
                                  const Scenario& scenario) {
  if (!scenario.protocol) {
    return fail(ErrorCode::usage, "a bundle needs a protocol", {},
                "name one in the scenario: \"protocol\": \"production\"");
  }
  const ProtocolRun& run = *scenario.protocol;
  SIXPOINT_ASSIGN(const ProtocolRecord record, record_protocol(run));
  SIXPOINT_CHECK(files.make_folders(folder));

  const auto rate = static_cast<std::size_t>(scenario.rate_hz);
  const std::size_t samples = record.counts.size();
  Bytes log = log_preamble(scenario.unit, scenario.start, scenario.rate_hz);
  constexpr std::size_t kRecordOverhead = 16;
  log.reserve(log.size() + samples * sizeof(gt3x::Counts) +
              (samples / rate + 1) * kRecordOverhead);  // append_record grows a log to fit
  std::int64_t second = 0;
  for (std::size_t first = 0; first < samples; first += rate, ++second) {
    append_second(log, scenario.start + std::chrono::seconds(second),
                  std::span(record.counts).subspan(first, std::min(rate, samples - first)), true);
  }
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, folder + "/recording.gt3x"));
  SIXPOINT_CHECK(writer.add("log.bin", std::move(log)));
  SIXPOINT_CHECK(writer.add(
      "info.txt", recording_info(scenario.unit, scenario.start,
                                 scenario.start + std::chrono::seconds(second), scenario.rate_hz)
                      .serialise()));
  SIXPOINT_CHECK(writer.commit());

  SIXPOINT_CHECK(
      write_file(files, folder + "/temperature.csv", temperature_text(run, scenario.seed)));
  SIXPOINT_CHECK(
      write_file(files, folder + "/host_clock.csv", clock_text(run, record, rate, scenario.seed)));
  SIXPOINT_CHECK(
      write_file(files, folder + "/protocol.json", protocol_text(scenario, run, record)));

  BundleReport report;
  report.samples = samples;
  report.duration_s = static_cast<double>(samples) / scenario.rate_hz;
  report.segments = run.segments.size();
  return report;
}

}  // namespace sixpoint::sim
