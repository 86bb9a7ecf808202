#include "gap/judge/diagnose.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "gap/explain/catalogue.h"
#include "gap/explain/temperature_lag.h"
#include "gap/judge/next_segments.h"
#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// Tones whose amplitudes follow no known response, by so many standard deviations, would bend all
// other estimates: they are left out.
constexpr double kNoResponse_sd = 20;
// Poses this far from the protocol's, on average, are other poses.
constexpr double kOtherPoses_g = 0.45;
constexpr double kOtherPosesAlarm_sd = 50;
// Gains and offsets are six numbers of three axes: fewer directions do not determine them.
constexpr std::size_t kLeastPoses = 4;

Records judge_records(const Request& request, CleanSamples clean, NoiseSpectrum noise,
                      Findings& found) {
  const CodeStatistics codes = code_statistics(request.bundle, clean);
  Lines lines = judge_lines(request, clean, noise, codes);
  Timing timing = judge_timing(request, clean, noise, lines);
  ResponseStep response = judge_response(request, noise, timing.tones, lines);
  Settling settling = judge_settling(request, clean, noise, lines, response.response);
  for (Findings* step : {&timing.found, &lines.found, &response.found, &settling.found}) {
    found.append(std::move(*step));
  }
  if (response.response.tone_left_sd > kNoResponse_sd) {
    for (ToneFit& tone : timing.tones) {
      tone.usable = tone.usable && tone.clipped_share == 0;
    }
  }
  SlowNoise slow = slow_noise(request.bundle, clean, noise);
  return {std::move(clean), std::move(noise),        codes,
          timing.host,      std::move(timing.tones), timing.jitter_s,
          std::move(lines), response.response,       std::move(settling),
          std::move(slow)};
}

// The samples of a clipped tone that are not clipped show its curve up to the limit, further than all
// other tones, where neither filter, mount nor jitter changes its form.
std::vector<Block> blocks_of(const Bundle& bundle, const Records& records) {
  std::vector<ToneFit> tones = records.tones;
  const bool has_response = records.response.tone_left_sd > kNoResponse_sd;
  const bool has_form = !records.response.low_pass_significant &&
                        !records.response.resonance_significant && records.jitter_s == 0;
  for (ToneFit& tone : tones) {
    tone.usable = tone.usable && !has_response && (tone.clipped_share == 0 || has_form);
  }
  return make_blocks(bundle, records.clean, records.noise, tones, records.response);
}

// Directions of gravity, on a grid of half a g.
std::size_t poses_of(const std::vector<Block>& blocks) {
  std::set<std::array<long, 3>> poses;
  for (const Block& block : blocks) {
    const Eigen::Vector3d up = 2 * block.rotation.col(2);
    poses.insert({std::lround(up[0]), std::lround(up[1]), std::lround(up[2])});
  }
  return poses.size();
}

std::ptrdiff_t flagged(const CleanSamples& clean, SampleFlag flag) {
  return std::count_if(clean.flags.begin(), clean.flags.end(),
                       [&](std::uint8_t flags) { return (flags & flag) != 0; });
}

Diagnosis header_of(const Request& request, const ProtocolKind& kind) {
  const Bundle& bundle = request.bundle;
  Diagnosis out;
  out.bundle = bundle.path;
  out.protocol = kind.name;
  out.serial = bundle.protocol_serial.empty() ? bundle.header.serial : bundle.protocol_serial;
  out.firmware = bundle.header.firmware;
  out.losses = bundle.losses;
  out.seed = request.options.seed;
  return out;
}

// All that follows from the records, and from the temperatures of the bundle.
Diagnosis diagnose_records(const Request& request, const ProtocolKind& kind, const Records& records,
                           PoseCheck poses, Findings found, Diagnosis out) {
  const Bundle& bundle = request.bundle;
  const std::vector<Block> blocks = blocks_of(bundle, records);
  if (blocks.empty()) {
    return inconclusive(request.options, std::move(found),
                        "no dwell of two unmasked seconds is left", std::move(out));
  }
  if (records.clean.pose_error_g > kOtherPoses_g) {
    poses.wrong = true;
    found.alarm(kOtherPosesAlarm_sd,
                "pose: the recording's axes do not follow the protocol's poses");
  }
  const std::size_t pose_count = poses_of(blocks);

  const Explanation explanation = explain(request, blocks, records.slow);
  found.append(judge_means(request, explanation, records.slow, found));
  Nuisances nuisances =
      judge_nuisances(request, explanation.best().state,
                      pose_count >= kLeastPoses && !poses.wrong && !request.options.uncalibrated);
  out.unit.gain = nuisances.unit.gain;
  out.unit.offset_g = nuisances.unit.offset_g;
  found.append(std::move(nuisances.found));
  undo_later_effects(found);
  found.append(judge_left_over(request, records, explanation, found));

  list_not_observable(request, kind, records, explanation, found, out);
  out.next_segments = next_segments(request, kind.abilities, explanation, found, out);
  out.gap = measure_gap(records, explanation, found);
  Residuals residuals = locate_residuals(request, records, explanation, found);
  out.plots = make_plots(request, records, explanation.best(), found);
  out.plots.residuals = std::move(residuals.plot);
  out.where = std::move(residuals.where);
  if (!found.alarms.empty()) {
    out.unknown.where = locate_unknown(request, records, explanation, found);
  }
  if (pose_count < kLeastPoses) {
    const std::string few =
        fmt::format("{} pose{} only: gains and offsets of the unit can't be told from effects",
                    pose_count, pose_count == 1 ? "" : "s");
    // Two poses fit any gains and offsets, and what else is there.
    if (found.effects.empty() && found.alarms.empty()) {
      return inconclusive(request.options, std::move(found), few, std::move(out));
    }
    out.losses.push_back(few);
  }
  finish(request, std::move(found), out);
  return out;
}

Diagnosis diagnose(const Request& request) {
  const Bundle& bundle = request.bundle;
  const ProtocolKind kind = protocol_kind(bundle);
  Diagnosis out = header_of(request, kind);
  CleanSamples clean = clean_samples(bundle);
  mark_slips(host_timing(bundle), clean);
  Findings found = judge_marks(request, clean);
  PoseCheck poses = judge_poses(bundle, clean);
  if (poses.moving) {
    return inconclusive(
        request.options, std::move(found),
        "the unit moves inside the segments: the protocol's sample numbers are not of this "
        "recording",
        std::move(out));
  }
  found.append(std::move(poses.found));
  NoiseSpectrum noise = noise_spectrum(bundle, clean);
  if (!noise.usable()) {
    return inconclusive(
        request.options, std::move(found),
        fmt::format(
            "too little of the recording lies still and unmasked to know even its noise: of "
            "{} samples {} are zero on all axes, {} hold one value and {} are clipped",
            clean.flags.size(), flagged(clean, kSampleZero), flagged(clean, kSampleHeld),
            flagged(clean, kSampleClipped)),
        std::move(out));
  }
  const Records records = judge_records(request, std::move(clean), std::move(noise), found);
  out.unit.noise_mg = records.response.white_mg;
  const double lag_s =
      bundle.temperature.empty()
          ? likeliest_lag_s(bundle, blocks_of(bundle, records), {.lsb_mg = request.lsb_mg()})
          : 0;
  if (lag_s > 0) {
    out.losses.push_back(fmt::format(
        "the unit follows the commanded temperature with a lag of {:.0f} s, as its readings show",
        lag_s));
    Bundle followed = bundle;
    followed.temperature = following_temperature(bundle, lag_s);
    return diagnose_records({followed, request.options}, kind, records, std::move(poses),
                            std::move(found), std::move(out));
  }
  return diagnose_records(request, kind, records, std::move(poses), std::move(found),
                          std::move(out));
}

}  // namespace

Result<Diagnosis> diagnose(const Bundle& bundle, const DiagnoseOptions& options) {
  for (const std::string& name : options.without) {
    if (find_entry(name) == nullptr) {
      std::vector<std::string_view> names;
      for (const CatalogueEntry& entry : catalogue()) {
        names.push_back(entry.name);
      }
      return fail(ErrorCode::usage,
                  fmt::format("the catalogue has no effect '{}'", printable(name, 60)), "--without",
                  fmt::format("use one of: {}", fmt::join(names, ", ")));
    }
  }
  return diagnose(Request{bundle, options});
}

}  // namespace sixpoint::gap
