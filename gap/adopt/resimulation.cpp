#include "gap/adopt/resimulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "gap/judge/gap_against.h"
#include "sim/protocol_run.h"

namespace sixpoint::gap {

namespace {

template <std::size_t N>
bool one_of(std::string_view name, const std::array<std::string_view, N>& names) {
  return std::ranges::find(names, name) != names.end();
}

bool is_measured_by_size(std::string_view name) {
  constexpr std::array<std::string_view, 11> kBySize = {
      "settling",    "floor_vibration", "electrical_line",    "axis_rotation",
      "clock_error", "dropped_samples", "duplicated_samples", "saturation",
      "wrap",        "idle_sleep",      "charging_zeros"};
  return one_of(name, kBySize);
}

sim::ProtocolRun run_of(const RecordedBundle& recorded, std::uint64_t seed) {
  const Bundle& bundle = recorded.bundle;
  sim::ProtocolRun run;
  run.rate_hz = bundle.rate_hz;
  run.accel_scale_lsb_per_g = bundle.accel_scale_lsb_per_g;
  run.gravity_g = bundle.gravity_g;
  run.seed = seed;
  run.gain = recorded.diagnosis.unit.gain;
  run.offset_g = recorded.diagnosis.unit.offset_g;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (recorded.diagnosis.unit.noise_mg[axis] > 0) {
      run.noise_mg[axis] = recorded.diagnosis.unit.noise_mg[axis];
    }
  }
  double end_s = bundle.segments.front().host_start_s;
  for (const Segment& segment : bundle.segments) {
    constexpr std::array kKinds = {sim::SegmentKind::still, sim::SegmentKind::vibration,
                                   sim::SegmentKind::ramp, sim::SegmentKind::soak};
    sim::ProtocolSegment out;
    out.name = segment.name;
    out.kind = kKinds[static_cast<std::size_t>(segment.kind)];
    out.first_sample = segment.first_sample;
    out.samples = segment.samples;
    out.host_start_s = segment.host_start_s;
    out.rotation = segment.rotation;
    out.commanded_c = {segment.temperature_start_c, segment.temperature_end_c};
    if (segment.vibration) {
      out.vibration = sim::Tone{segment.vibration->direction_lab, segment.vibration->frequency_hz,
                                segment.vibration->amplitude_g, 0};
    }
    run.segments.push_back(std::move(out));
    end_s = std::max(end_s,
                     segment.host_start_s + static_cast<double>(segment.samples) / bundle.rate_hz);
  }
  // The host's clock may have begun long before the first segment.
  auto second = static_cast<std::int64_t>(std::floor(bundle.segments.front().host_start_s));
  for (; static_cast<double>(second) <= end_s + 1; ++second) {
    const auto time_s = static_cast<double>(second);
    run.temperature.push_back({time_s, bundle.temperature_at(time_s)});
  }
  return run;
}

// Mean squares of what leaves the means alone, by effect.
std::map<std::string, double> sizes_of(const Diagnosis& diagnosis) {
  std::map<std::string, double> sizes;
  for (const EffectFinding& effect : diagnosis.effects) {
    if (is_measured_by_size(effect.name)) {
      sizes[effect.name] = effect.gap_mg2;
    }
  }
  return sizes;
}

// The sizes that the same diagnosis measures in the simulation.
Result<std::map<std::string, double>> simulated_sizes(const RecordedBundle& recorded,
                                                      const sim::ProtocolRun& run) {
  SIXPOINT_ASSIGN(sim::ProtocolRecord record, sim::record_protocol(run));
  Bundle simulated = recorded.bundle;
  simulated.samples = std::move(record.counts);
  simulated.samples.resize(recorded.bundle.samples.size());
  for (std::size_t i = 0; i < simulated.host_clock.sample_index.size(); ++i) {
    const std::size_t sample = simulated.host_clock.sample_index[i];
    if (sample < record.sample_time_s.size()) {
      simulated.host_clock.host_time_s[i] = record.sample_time_s[sample];
    }
  }
  SIXPOINT_ASSIGN(const Diagnosis diagnosis, diagnose(simulated, recorded.how));
  return sizes_of(diagnosis);
}

// Of a wrong acquisition mode: a common gain, and offsets, as judge_nuisances() counts them.
double mismatch_mg2(const UnitEstimate& unit) {
  const double common = (unit.gain[0] + unit.gain[1] + unit.gain[2]) / 3;
  double square = std::pow(1000 * (1 - common), 2);
  for (const double offset_g : unit.offset_g) {
    square += std::pow(1000 * offset_g, 2);
  }
  return square / 3;
}

}  // namespace

bool is_scatter(std::string_view effect) {
  constexpr std::array<std::string_view, 4> kScatter = {"seating", "random_walk", "flicker",
                                                        "jitter"};
  return one_of(effect, kScatter);
}

Result<RecordedBundle> recorded_bundle(Bundle bundle, const DiagnoseOptions& how) {
  SIXPOINT_ASSIGN(Diagnosis diagnosis, diagnose(bundle, how));
  return RecordedBundle{std::move(bundle), how, std::move(diagnosis)};
}

Result<BundleGap> gap_with(const RecordedBundle& recorded,
                           const std::vector<sim::EffectSpec>& effects, std::uint64_t seed) {
  sim::ProtocolRun run = run_of(recorded, seed);
  std::vector<gt3x::Counts> without = recorded.bundle.samples;
  std::vector<gt3x::Counts> with = without;
  std::map<std::string, double> simulated;
  for (const sim::EffectSpec& effect : effects) {
    if (!is_scatter(effect.kind->name)) {
      run.effects.push_back(effect);
    }
  }
  if (!run.effects.empty()) {
    SIXPOINT_ASSIGN(with, sim::run_protocol(run));
    if (std::ranges::any_of(run.effects,
                            [](const auto& e) { return is_measured_by_size(e.kind->name); })) {
      SIXPOINT_ASSIGN(simulated, simulated_sizes(recorded, run));
    }
    run.effects.clear();
    SIXPOINT_ASSIGN(without, sim::run_protocol(run));
    with.resize(recorded.bundle.samples.size());
    without.resize(recorded.bundle.samples.size());
  }
  SIXPOINT_ASSIGN(const GapAgainst means, gap_against(recorded.bundle, with, without));
  BundleGap gap;
  gap.means_mg = means.gap_mg;
  gap.floor_mg = means.floor_mg;
  double size_mg2 = 0;
  std::map<std::string, double> in_recording = sizes_of(recorded.diagnosis);
  for (const auto& [name, mg2] : simulated) {
    in_recording.emplace(name, 0);
  }
  for (const auto& [name, mg2] : in_recording) {
    const auto other = simulated.find(name);
    const double there = other == simulated.end() ? 0 : std::sqrt(other->second);
    size_mg2 += std::pow(std::sqrt(mg2) - there, 2);
  }
  for (const EffectFinding& effect : recorded.diagnosis.effects) {
    size_mg2 += effect.name == "filter_mismatch" ? mismatch_mg2(means.unit) : 0;
  }
  gap.by_size_mg = std::sqrt(size_mg2);
  gap.gap_mg = std::hypot(gap.means_mg, gap.by_size_mg);
  return gap;
}

}  // namespace sixpoint::gap
