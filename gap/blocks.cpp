#include "gap/blocks.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace sixpoint::gap {
namespace {

constexpr double kPiece_s = 120;  // of long records: temperature moves by 2 C at most meanwhile
constexpr int kFolds = 8;

}  // namespace

std::vector<Block> make_blocks(const Bundle& bundle, const CleanSamples& clean,
                               const NoiseSpectrum& noise, const std::vector<ToneFit>& tones,
                               const Response& response) {
  std::vector<Block> blocks;
  std::map<std::string, int> conditions;
  const auto condition_of = [&](const std::string& key) {
    const auto [at, fresh] = conditions.emplace(key, static_cast<int>(conditions.size()));
    return at->second % kFolds;
  };
  const double mg_per_lsb = 1000 / bundle.accel_scale_lsb_per_g;
  const Eigen::Vector3d white2(std::pow(noise.white_mg[0], 2), std::pow(noise.white_mg[1], 2),
                               std::pow(noise.white_mg[2], 2));
  std::size_t tone_at = 0;
  int session = 0;
  for (std::size_t s = 0; s < bundle.segments.size(); ++s) {
    const Segment& segment = bundle.segments[s];
    Block block;
    block.segment = s;
    block.placement = segment.placement;
    if (s > 0 && segment.name != bundle.segments[s - 1].name) {
      ++session;
    }
    block.session = session;
    block.gravity_lab_g = bundle.gravity_g * Eigen::Vector3d::UnitZ();
    block.rotation = segment.rotation;
    block.approach_g = segment.approach_g;
    block.held_sign = segment.held_sign;
    block.noise_mg = white2.cwiseSqrt();
    if (segment.vibration) {
      const ToneFit& tone = tones[tone_at++];
      const bool odd_frequency = tone.frequency_sd_ppm > 0 && std::abs(tone.frequency_ppm) > 6500;
      if (!tone.usable || tone.clipped_share > 0 || !tone.slips.empty() || odd_frequency) {
        continue;
      }
      block.tone = true;
      block.axis = tone.axis;
      const double f = segment.vibration->frequency_hz;
      const double h = response.tone_gain(f, bundle.rate_hz);
      block.vibration_lab_g = h * segment.vibration->amplitude_g * segment.vibration->direction_lab;
      block.harmonics = segment.vibration->amplitude_g * h > 0.5;
      block.value_mg.resize(block.harmonics ? 8 : 6);
      block.white_mg2 = Eigen::MatrixXd::Zero(block.value_mg.size(), block.value_mg.size());
      block.value_mg.head<3>() = tone.level_mg;
      block.value_mg.segment<3>(3) = tone.in_phase_mg;
      const auto n = static_cast<double>(tone.samples);
      for (Eigen::Index a = 0; a < 3; ++a) {
        block.white_mg2(a, a) = white2[a] / n;
        block.white_mg2(3 + a, 3 + a) = 2 * noise.variance_at(static_cast<std::size_t>(a), f) / n;
      }
      // What the tone itself adds to the noise counts where it is seen.
      const double own = noise.variance_at(static_cast<std::size_t>(tone.axis), f);
      const double variance = tone.residual_mg * tone.residual_mg > 1.3 * own
                                  ? tone.residual_mg * tone.residual_mg
                                  : own;
      const std::array<Eigen::Index, 4> rows = {tone.axis, 3 + tone.axis, 6, 7};
      const std::size_t used = block.harmonics ? 4 : 2;
      for (std::size_t i = 0; i < used; ++i) {
        for (std::size_t j = 0; j < used; ++j) {
          const auto ti = static_cast<Eigen::Index>(i);
          const auto tj = static_cast<Eigen::Index>(j);
          block.white_mg2(rows[i], rows[j]) = variance * tone.covariance_shape(ti, tj);
        }
      }
      // The response's form is known so well only, and never better than three thousandths of what
      // it takes off or adds.
      const double form_mg =
          std::hypot(response.tone_form_share, 0.003 * std::log(h)) * tone.in_phase_mg[tone.axis];
      block.white_mg2(3 + tone.axis, 3 + tone.axis) += form_mg * form_mg;
      if (block.harmonics) {
        block.value_mg[6] = tone.second_mg;
        block.value_mg[7] = tone.third_mg;
      }
      block.seconds = static_cast<double>(segment.samples) / bundle.rate_hz;
      block.middle_s = segment.host_start_s + block.seconds / 2;
      block.temperature_c = bundle.temperature_at(block.middle_s);
      block.condition = condition_of("tone " + std::to_string(f));
      blocks.push_back(std::move(block));
      continue;
    }
    const auto piece = static_cast<std::size_t>(kPiece_s * bundle.rate_hz);
    const std::size_t skip =
        segment.starts_placement
            ? std::min(segment.samples / 4, static_cast<std::size_t>(bundle.rate_hz))
            : 0;
    for (std::size_t first = skip; first < segment.samples; first += piece) {
      std::size_t last = std::min(segment.samples, first + piece);
      if (segment.samples - last < piece / 4) {
        last = segment.samples;
      }
      std::array<double, 3> sum{};
      double n = 0;
      double index = 0;
      for (std::size_t i = first; i < last; ++i) {
        const std::size_t at = segment.first_sample + i;
        if ((clean.flags[at] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0) {
          for (std::size_t a = 0; a < 3; ++a) {
            sum[a] += clean.samples[at][a];
          }
          n += 1;
          index += static_cast<double>(i);
        }
      }
      if (n >= 2 * bundle.rate_hz) {
        Block dwell = block;
        dwell.value_mg.resize(3);
        dwell.white_mg2 = Eigen::MatrixXd::Zero(3, 3);
        for (Eigen::Index a = 0; a < 3; ++a) {
          dwell.value_mg[a] = sum[static_cast<std::size_t>(a)] / n * mg_per_lsb;
          dwell.white_mg2(a, a) = white2[a] / n;
        }
        dwell.seconds = n / bundle.rate_hz;
        dwell.middle_s = segment.host_start_s + index / n / bundle.rate_hz;
        // Mean temperature over the piece, in five steps.
        dwell.temperature_c = 0;
        for (int k = -2; k <= 2; ++k) {
          dwell.temperature_c +=
              bundle.temperature_at(dwell.middle_s + 0.2 * k * dwell.seconds) / 5;
        }
        const Eigen::Vector3d up = segment.rotation.col(2);
        dwell.condition = condition_of(segment.name + " " + std::to_string(std::lround(4 * up[0])) +
                                       std::to_string(std::lround(4 * up[1])) +
                                       std::to_string(std::lround(4 * up[2])) + " " +
                                       std::to_string(std::lround(dwell.temperature_c / 5)));
        blocks.push_back(std::move(dwell));
      }
      if (last == segment.samples) {
        break;
      }
    }
  }
  return blocks;
}

}  // namespace sixpoint::gap
