#include "gap/explain/blocks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

namespace sixpoint::gap {
namespace {

// Conventions, with their reasons.
constexpr double kPiece_s = 120;            // temperature moves by 2 C at most meanwhile
constexpr double kMostPieces = 500;         // longer ones where a recording would have more
constexpr double kRinging_s = 1;            // left out after a move
constexpr double kLeastDwell_s = 2;         // of unmasked samples
constexpr int kFolds = 8;                   // of hold-out
constexpr double kOddFrequency_ppm = 6500;  // a tone this far off has a frequency of its own
constexpr double kHarmonics_g = 0.5;        // smaller tones show no harmonics
// A tone whose residual has this many times the noise's variance adds to the noise itself.
constexpr double kLoudResidual = 1.3;
// How well the response's form is known at least, as a share of what it takes off or adds.
constexpr double kToneFormShare = 0.003;

// Numbers the conditions in the order of their appearance.
class Conditions {
 public:
  int fold_of(const std::string& key) {
    return numbers_.emplace(key, static_cast<int>(numbers_.size())).first->second % kFolds;
  }

 private:
  std::map<std::string, int> numbers_;
};

Eigen::Vector3d white_mg2(const NoiseSpectrum& noise) {
  return {std::pow(noise.white_mg[0], 2), std::pow(noise.white_mg[1], 2),
          std::pow(noise.white_mg[2], 2)};
}

// Standard deviation of one sample before it is stored: over the whole spectrum, which a low-pass
// narrows, less what storing adds.
Eigen::Vector3d sample_noise_mg(const NoiseSpectrum& noise, double lsb_mg) {
  Eigen::Vector3d sd_mg = Eigen::Vector3d::Zero();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const std::vector<double>& mg2 = noise.variance_mg2[static_cast<std::size_t>(axis)];
    if (!mg2.empty()) {
      const double stored_mg2 =
          std::accumulate(mg2.begin(), mg2.end(), 0.0) / static_cast<double>(mg2.size());
      sd_mg[axis] = std::sqrt(std::max(0.0, stored_mg2 - lsb_mg * lsb_mg / 12));
    }
  }
  return sd_mg;
}

bool gives_block(const ToneFit& tone) {
  const bool odd_frequency =
      tone.frequency_sd_ppm > 0 && std::abs(tone.frequency_ppm) > kOddFrequency_ppm;
  return tone.usable && tone.slips.empty() && !odd_frequency;
}

// Covariance of a tone's features. `gain`: the response at its frequency.
Eigen::MatrixXd tone_covariance(const Block& block, const ToneFit& tone, const NoiseSpectrum& noise,
                                const Response& response, double frequency_hz, double gain) {
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(block.size(), block.size());
  const Eigen::Vector3d white2 = white_mg2(noise);
  for (Eigen::Index a = 0; a < 3; ++a) {
    v(a, a) = white2[a] * tone.cross_shape(0, 0);
    v(kToneAmplitude + a, kToneAmplitude + a) =
        noise.variance_at(static_cast<std::size_t>(a), frequency_hz) * tone.cross_shape(1, 1);
  }
  const double own = noise.variance_at(static_cast<std::size_t>(tone.axis), frequency_hz);
  const double residual2 = tone.residual_mg * tone.residual_mg;
  const double variance = residual2 > kLoudResidual * own ? residual2 : own;
  const std::array<Eigen::Index, 4> rows = {tone.axis, kToneAmplitude + tone.axis, kSecondHarmonic,
                                            kThirdHarmonic};
  const std::size_t used = block.harmonics ? 4 : 2;
  for (std::size_t i = 0; i < used; ++i) {
    for (std::size_t j = 0; j < used; ++j) {
      v(rows[i], rows[j]) = variance * tone.covariance_shape(static_cast<Eigen::Index>(i),
                                                             static_cast<Eigen::Index>(j));
    }
  }
  for (Eigen::Index a = 0; a < 3; ++a) {
    v(kToneAmplitude + a, kToneAmplitude + a) += tone.line_mg2[0][a];
  }
  if (block.harmonics) {
    v(kSecondHarmonic, kSecondHarmonic) += tone.line_mg2[1][tone.axis];
    v(kThirdHarmonic, kThirdHarmonic) += tone.line_mg2[2][tone.axis];
  }
  const double form_mg = std::hypot(response.tone_form_share, kToneFormShare * std::log(gain)) *
                         tone.in_phase_mg[tone.axis];
  v(rows[1], rows[1]) += form_mg * form_mg;
  return v;
}

// `block`: what all blocks of the segment have in common.
Block tone_block(Block block, const Bundle& bundle, const NoiseSpectrum& noise, const ToneFit& tone,
                 const Response& response, Conditions& conditions) {
  const Segment& segment = bundle.segments[block.segment];
  const double f = segment.vibration->frequency_hz;
  block.tone = true;
  block.axis = tone.axis;
  block.vibration_lab_g =
      response.mount_gain(f) * segment.vibration->amplitude_g * segment.vibration->direction_lab;
  block.filter_gain = response.filter_gain(f, bundle.rate_hz);
  // A filter's gain at a harmonic depends on whether it stands before the sampling.
  block.harmonics = !response.low_pass_significant && block.vibration_lab_g.norm() > kHarmonics_g;
  block.value_mg.resize(block.harmonics ? 8 : 6);
  block.value_mg.head<3>() = tone.level_mg;
  block.value_mg.segment<3>(kToneAmplitude) = tone.in_phase_mg;
  if (block.harmonics) {
    block.value_mg[kSecondHarmonic] = tone.second_mg;
    block.value_mg[kThirdHarmonic] = tone.third_mg;
  }
  block.white_mg2 =
      tone_covariance(block, tone, noise, response, f, response.tone_gain(f, bundle.rate_hz));
  block.seconds = static_cast<double>(segment.samples) / bundle.rate_hz;
  block.middle_s = segment.host_start_s + block.seconds / 2;
  block.temperature_c = bundle.temperature_at(block.middle_s);
  block.condition = conditions.fold_of("tone " + std::to_string(f));
  return block;
}

std::string dwell_condition(const Segment& segment, double temperature_c) {
  const Eigen::Vector3d up = segment.rotation.col(2);
  return segment.name + " " + std::to_string(std::lround(4 * up[0])) +
         std::to_string(std::lround(4 * up[1])) + std::to_string(std::lround(4 * up[2])) + " " +
         std::to_string(std::lround(temperature_c / 5));
}

// Samples first..last of the segment; nothing where too few are unmasked.
void add_dwell(Block block, const Bundle& bundle, const CleanSamples& clean,
               const NoiseSpectrum& noise, std::size_t first, std::size_t last,
               Conditions& conditions, std::vector<Block>& blocks) {
  const Segment& segment = bundle.segments[block.segment];
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
  double index = 0;
  for (std::size_t i = first; i < last; ++i) {
    const std::size_t at = segment.first_sample + i;
    if (clean.usable(at)) {
      const gt3x::Counts& counts = clean.samples[at];
      sum += Eigen::Vector3d(counts[0], counts[1], counts[2]);
      n += 1;
      index += static_cast<double>(i);
    }
  }
  if (n < kLeastDwell_s * bundle.rate_hz) {
    return;
  }
  const double mg_per_lsb = 1000 / bundle.accel_scale_lsb_per_g;
  block.value_mg = sum / n * mg_per_lsb;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    block.truncated_mg[axis] = truncated_mg(block.value_mg[axis], block.noise_mg[axis], mg_per_lsb);
  }
  block.white_mg2 = Eigen::Vector3d(white_mg2(noise) / n).asDiagonal();
  block.seconds = n / bundle.rate_hz;
  block.middle_s = segment.host_start_s + index / n / bundle.rate_hz;
  // Mean temperature over the piece, in five steps.
  block.temperature_c = 0;
  for (int k = -2; k <= 2; ++k) {
    block.temperature_c += bundle.temperature_at(block.middle_s + 0.2 * k * block.seconds) / 5;
  }
  block.condition = conditions.fold_of(dwell_condition(segment, block.temperature_c));
  blocks.push_back(std::move(block));
}

double piece_s(const Bundle& bundle) {
  return std::max(kPiece_s,
                  static_cast<double>(bundle.samples.size()) / bundle.rate_hz / kMostPieces);
}

// A long record is cut into pieces; a short rest stays with the last.
void add_dwells(const Block& block, const Bundle& bundle, const CleanSamples& clean,
                const NoiseSpectrum& noise, Conditions& conditions, std::vector<Block>& blocks) {
  const Segment& segment = bundle.segments[block.segment];
  const auto piece = static_cast<std::size_t>(piece_s(bundle) * bundle.rate_hz);
  std::size_t first =
      segment.may_ring()
          ? std::min(segment.samples / 4, static_cast<std::size_t>(kRinging_s * bundle.rate_hz))
          : 0;
  while (first < segment.samples) {
    std::size_t last = std::min(segment.samples, first + piece);
    if (segment.samples - last < piece / 4) {
      last = segment.samples;
    }
    add_dwell(block, bundle, clean, noise, first, last, conditions, blocks);
    first = last;
  }
}

}  // namespace

std::vector<Block> make_blocks(const Bundle& bundle, const CleanSamples& clean,
                               const NoiseSpectrum& noise, const std::vector<ToneFit>& tones,
                               const Response& response) {
  std::vector<Block> blocks;
  const Eigen::Vector3d noise_mg = sample_noise_mg(noise, 1000 / bundle.accel_scale_lsb_per_g);
  Conditions conditions;
  std::size_t tone_at = 0;
  int session = 0;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const Segment& segment = bundle.segments[s];
    session += s > 0 && segment.name != bundle.segments[s - 1].name ? 1 : 0;
    Block block;
    block.segment = s;
    block.placement = segment.placement;
    block.session = session;
    block.gravity_lab_g = bundle.gravity_g * Eigen::Vector3d::UnitZ();
    block.rotation = segment.rotation;
    block.approach_g = segment.approach_g;
    block.held_sign = segment.held_sign;
    block.noise_mg = noise_mg;
    if (!segment.vibration) {
      add_dwells(block, bundle, clean, noise, conditions, blocks);
    } else if (const ToneFit& tone = tones[tone_at++]; gives_block(tone)) {
      blocks.push_back(tone_block(block, bundle, noise, tone, response, conditions));
    }
  }
  set_ripples(blocks);
  return blocks;
}

}  // namespace sixpoint::gap
