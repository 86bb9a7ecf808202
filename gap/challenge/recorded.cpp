#include "gap/challenge/recorded.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/atomic_file.h"
#include "base/random.h"
#include "gap/recording/bundle.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "repair/rescale/rescaled_log.h"
#include "repair/triage/survey.h"
#include "sim/recording.h"
#include "sim/unit_truth.h"

namespace sixpoint::gap {

namespace {

constexpr std::uint64_t kFractionStream = 0x66726163;
constexpr std::size_t kBlock = 512;
constexpr double kLowest_lsb = -2048;
constexpr double kHighest_lsb = 2047;

class Adding {
 public:
  Adding(const gap::Bundle& bundle, const std::vector<sim::EffectSpec>& specs, std::uint64_t seed)
      : bundle_(bundle),
        effects_(sim::make_effects(specs, seed)),
        fraction_(seed, kFractionStream),
        counts_(bundle.samples) {
    // What firmware makes of counts needs no fraction of them.
    analog_ = std::any_of(specs.begin(), specs.end(), [](const sim::EffectSpec& spec) {
      return spec.kind->stage != sim::Stage::firmware;
    });
    sim::RecordingPlan plan{bundle.rate_hz, bundle.samples.size(), {}};
    for (const gap::Segment& segment : bundle.segments) {
      plan.rests.push_back({segment.first_sample, segment.samples});
    }
    for (const auto& effect : effects_) {
      effect->on_digital(format_);
      effect->on_recording(plan);
    }
  }

  Status problem() const { return sim::check_effects(effects_); }

  std::vector<gt3x::Counts> run() {
    Eigen::Matrix3d before = bundle_.segments.front().rotation;
    for (const gap::Segment& segment : bundle_.segments) {
      const sim::Placement placement{segment.host_start_s, segment.rotation, before,
                                     segment.starts_placement, !segment.starts_placement};
      for (const auto& effect : effects_) {
        effect->on_placement(placement);
      }
      before = segment.rotation;
      for (std::size_t done = 0; done < segment.samples; done += kBlock) {
        add(segment, done, std::min(kBlock, segment.samples - done));
      }
    }
    return std::move(counts_);
  }

 private:
  void add(const gap::Segment& segment, std::size_t first, std::size_t count) {
    const std::size_t at = segment.first_sample + first;
    block_.first_sample = at;
    block_.clock_start_s = segment.host_start_s;
    block_.time_s.resize(count);
    block_.temperature_c.resize(count);
    block_.true_g.resize(count);
    block_.sensed_g.resize(count);
    block_.stored.resize(count);
    const Eigen::Vector3d gravity(0, 0, bundle_.gravity_g);
    block_.motion.assign(count, {segment.rotation, gravity});
    for (std::size_t i = 0; i < count; ++i) {
      block_.time_s[i] = segment.host_start_s + static_cast<double>(first + i) / bundle_.rate_hz;
      block_.temperature_c[i] = bundle_.temperature_at(block_.time_s[i]);
    }
    for (const auto& effect : effects_) {
      effect->on_stimulus(block_);
    }
    const Eigen::Vector3d rest = segment.rotation * gravity;
    for (std::size_t i = 0; i < count; ++i) {
      const sim::MotionState& motion = block_.motion[i];
      block_.true_g[i] = motion.rotation * motion.force_lab_g;
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const double fraction = analog_ ? fraction_.uniform(-0.5, 0.5) : 0;
        block_.sensed_g[i][static_cast<Eigen::Index>(axis)] =
            (counts_[at + i][axis] + fraction) / bundle_.accel_scale_lsb_per_g;
      }
      block_.sensed_g[i] += block_.true_g[i] - rest;
    }
    for (const auto& effect : effects_) {
      effect->on_sensor(block_);
    }
    for (const auto& effect : effects_) {
      effect->on_analog(block_);
    }
    bool clipped = false;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const double lsb = format_.limited(block_.sensed_g[i][static_cast<Eigen::Index>(axis)]) *
                           bundle_.accel_scale_lsb_per_g;
        block_.stored[i][axis] =
            static_cast<std::int16_t>(format_.to_integer(lsb, kLowest_lsb, kHighest_lsb, clipped));
      }
    }
    for (const auto& effect : effects_) {
      effect->on_firmware(block_);
    }
    std::copy(block_.stored.begin(), block_.stored.end(),
              counts_.begin() + static_cast<std::ptrdiff_t>(at));
  }

  const gap::Bundle& bundle_;
  std::vector<std::unique_ptr<sim::Effect>> effects_;
  Random fraction_;
  std::vector<gt3x::Counts> counts_;
  sim::NumberFormat format_;
  bool analog_ = false;
  sim::SimulatedBlock block_;
};

}  // namespace

const std::vector<std::string>& effects_for_recordings() {
  static const std::vector<std::string> kNames = {
      "tilt",         "seating",         "settling",      "floor_vibration", "misalignment",
      "second_order", "hysteresis",      "warm_up",       "bandwidth",       "non_orthogonality",
      "random_walk",  "electrical_line", "axis_rotation", "idle_sleep",      "charging_zeros"};
  return kNames;
}

const std::vector<std::string>& effects_for_plain_recordings() {
  static const std::vector<std::string> kNames = {"filter_mismatch"};
  return kNames;
}

Status write_plain_trial(FileSystem& files, const std::string& from, const std::string& to,
                         const std::vector<sim::EffectSpec>& effects) {
  if (effects.size() > 1 || (effects.size() == 1 && effects[0].kind->name != "filter_mismatch")) {
    return fail(ErrorCode::usage, "a plain recording can be given a filter mismatch only", from,
                "give a bundle for other effects");
  }
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(files, from));
  if (survey.constants_problem) {
    return fail(*survey.constants_problem);
  }
  if (survey.already_repaired || survey.raw_counts || survey.constants.size() != 1) {
    return fail(ErrorCode::bad_data,
                "the counts of this recording do not come from one set of constants", from,
                "give a .gt3x file as the unit wrote it");
  }
  repair::RescaledLogOptions options;
  options.accel_scale_lsb_per_g = survey.accel_scale_lsb_per_g;
  options.first_constants = survey.constants.front();
  options.beyond_12_bits = survey.beyond_12_bits;
  options.affine = !survey.plausibility.plausible();
  options.size = survey.log_bytes;
  if (!effects.empty()) {
    // gain s (m - z) + offset = s' (m - z')
    const sim::ParameterSet& values = effects[0].values;
    SIXPOINT_ASSIGN(calib::Calibration fresh, calib::calibration_from(survey.constants.front()));
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      fresh.sensitivity_g_per_lsb[axis] *= values.find("gain")->second[0];
      fresh.zero_lsb[axis] -=
          values.find("offset_g")->second[axis] / fresh.sensitivity_g_per_lsb[axis];
    }
    options.fresh = fresh;
  }
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, from));
  SIXPOINT_ASSIGN(auto reader, recording.open_log());
  SIXPOINT_ASSIGN(auto log, repair::RescaledLog::make(std::move(reader), options));
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, to));
  for (const gt3x::EntryInfo& entry : recording.entries()) {
    if (entry.name != "log.bin") {
      SIXPOINT_CHECK(writer.copy(recording, entry.name));
    }
  }
  SIXPOINT_CHECK(writer.add("log.bin", *log));
  return writer.commit();
}

Status write_recorded_trial(FileSystem& files, const std::string& from, const std::string& to,
                            const std::vector<sim::EffectSpec>& effects, std::uint64_t seed) {
  SIXPOINT_ASSIGN(const gap::Bundle bundle, gap::read_bundle(files, from));
  for (const gap::Segment& segment : bundle.segments) {
    if (segment.vibration) {
      return fail(ErrorCode::usage, "effects can be added to recordings at rest only",
                  from + ": segment " + segment.name,
                  "give a bundle of faces, as a run of the jig is");
    }
  }
  Adding adding(bundle, effects, seed);
  SIXPOINT_CHECK(adding.problem());
  const std::vector<gt3x::Counts> counts = adding.run();
  sim::GivenProperties given;
  if (!bundle.header.serial.empty()) {
    given.serial = bundle.header.serial;
  }
  if (!bundle.header.firmware.empty()) {
    given.firmware = bundle.header.firmware;
  }
  given.accel_scale_lsb_per_g = bundle.accel_scale_lsb_per_g;
  const sim::UnitTruth unit = sim::draw_unit(seed, given);
  const UtcTime start = from_unix_seconds(1'640'439'383);
  const auto rate = static_cast<std::size_t>(std::lround(bundle.rate_hz));
  Bytes log = sim::log_preamble(unit, start, static_cast<int>(rate));
  std::int64_t second = 0;
  for (std::size_t first = 0; first < counts.size(); first += rate, ++second) {
    sim::append_second(log, start + std::chrono::seconds(second),
                       std::span(counts).subspan(first, std::min(rate, counts.size() - first)),
                       true);
  }
  SIXPOINT_CHECK(files.make_folders(to));
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, to + "/recording.gt3x"));
  SIXPOINT_CHECK(writer.add("log.bin", std::move(log)));
  SIXPOINT_CHECK(writer.add(
      "info.txt",
      sim::recording_info(unit, start, start + std::chrono::seconds(second), static_cast<int>(rate))
          .serialise()));
  SIXPOINT_CHECK(writer.commit());
  for (const char* name : {"/temperature.csv", "/host_clock.csv", "/protocol.json"}) {
    if (const auto text = read_file(files, from + name)) {
      SIXPOINT_CHECK(write_file(files, to + name,
                                {reinterpret_cast<const char*>(text->data()), text->size()}));
    }
  }
  return {};
}

}  // namespace sixpoint::gap
