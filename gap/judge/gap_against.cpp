#include "gap/judge/gap_against.h"

#include <map>
#include <utility>

#include "gap/judge/steps.h"

namespace sixpoint::gap {

namespace {

// Above this a tone shows what the sensor does at its limits; see docs/gap.md, measured by size.
constexpr double kSmallTone_g = 1.5;

using BlockKey = std::pair<std::size_t, int>;  // segment, and which of its blocks

std::map<BlockKey, Block> features_of(const Bundle& bundle) {
  const CleanSamples clean = clean_samples(bundle);
  const NoiseSpectrum noise = noise_spectrum(bundle, clean);
  const std::vector<ToneFit> tones = fit_tones(bundle, clean, {});
  Response flat;
  flat.white_mg = noise.white_mg;
  std::map<BlockKey, Block> features;
  std::map<std::size_t, int> in_segment;
  for (Block& block : make_blocks(bundle, clean, noise, tones, flat)) {
    const int which = in_segment[block.segment]++;
    if (!block.tone || block.vibration_lab_g.norm() < kSmallTone_g) {
      features.emplace(BlockKey{block.segment, which}, std::move(block));
    }
  }
  return features;
}

Bundle with_samples(const Bundle& bundle, const std::vector<gt3x::Counts>& samples) {
  Bundle other = bundle;
  other.samples = samples;
  return other;
}

}  // namespace

Result<GapAgainst> gap_against(const Bundle& recorded, const std::vector<gt3x::Counts>& with,
                               const std::vector<gt3x::Counts>& without) {
  if (with.size() != recorded.samples.size() || without.size() != recorded.samples.size()) {
    return fail(ErrorCode::bad_data, "a simulation has not as many samples as the recording",
                recorded.path, "simulate the protocol of this bundle");
  }
  std::map<BlockKey, Block> blocks_of_recording = features_of(recorded);
  const bool nothing_on = with == without;
  std::map<BlockKey, Block> on;
  std::map<BlockKey, Block> off;
  if (!nothing_on) {
    on = features_of(with_samples(recorded, with));
    off = features_of(with_samples(recorded, without));
  }
  std::vector<Block> blocks;
  for (auto& [key, block] : blocks_of_recording) {
    if (!nothing_on) {
      const auto a = on.find(key);
      const auto b = off.find(key);
      if (a == on.end() || b == off.end() || a->second.size() != block.size() ||
          b->second.size() != block.size()) {
        continue;
      }
      block.value_mg -= a->second.value_mg - b->second.value_mg;
    }
    blocks.push_back(std::move(block));
  }
  if (blocks.empty()) {
    return fail(ErrorCode::bad_data, "no dwell of two unmasked seconds can be compared",
                recorded.path, "leave this recording out");
  }
  // Nothing is explained: the effects are in the simulation.
  EvidenceOptions options{.lsb_mg = 1000 / recorded.accel_scale_lsb_per_g,
                          .allowed = [](const std::string&) { return false; }};
  const Explanation nominal(blocks, std::move(options));
  const GapSize gap = measure_gap({}, nominal, {});
  GapAgainst out;
  out.gap_mg = gap.before_mg;
  out.floor_mg = gap.floor_mg;
  out.sigma = gap.before_sigma;
  out.rows = nominal.model().rows();
  const ForwardState state = nominal.model().first_guess();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    out.unit.gain[axis] = state.gain[static_cast<Eigen::Index>(axis)];
    out.unit.offset_g[axis] = state.offset_mg[static_cast<Eigen::Index>(axis)] / 1000;
  }
  return out;
}

}  // namespace sixpoint::gap
