#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

double Diagnoser::slow_variance_mg2(double seconds) const {
  const Fit& fit = search_->best();
  if (fit.scatter == Scatter::flicker && accepted("flicker")) {
    // A density of F^2 / f between one period in this time and half the rate.
    return flicker_density_mg2(fit.scatter_size) * std::log(seconds * bundle_.rate_hz / 2);
  }
  if (fit.scatter == Scatter::random_walk && accepted("random_walk")) {
    return fit.scatter_size * fit.scatter_size * seconds / 6;  // of a walk less its mean
  }
  return 0;
}

void Diagnoser::judge_left_over() {
  const Fit& fit = search_->best();
  const double n = static_cast<double>(fit.residual.size());
  const double p = static_cast<double>(fit.posterior.columns.size());
  test(chi_to_sd(fit.residual.squaredNorm(), n - p), "mean: dwells and tones together");
  // Random scatter has its size in every part of the recording: too little of it is as telling as
  // too much. A row's chi-square is one less what the parameters took of it.
  const bool scattered = fit.scatter != Scatter::nominal && in_catalogue(fit.scatter);
  const std::vector<double> freedom_of_row = search_->row_freedom();
  std::map<std::string, std::array<double, 3>> groups;
  for (Eigen::Index row = 0; row < fit.residual.size(); ++row) {
    const int b = fit.row_block[static_cast<std::size_t>(row)];
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    auto& group = groups[bundle_.segments[block.segment].name];
    group[0] += fit.residual[row] * fit.residual[row];
    group[1] += 1;
    group[2] += freedom_of_row[static_cast<std::size_t>(row)];
  }
  for (const auto& [name, group] : groups) {
    // Tones of five samples a period meet a truncated zero at five phases only.
    if (accepted("truncation") && name.rfind("shaker", 0) == 0) {
      continue;
    }
    test(chi_to_sd(group[0], group[1]), fmt::format("mean: segment {}", name));
    if (scattered) {
      test(-chi_to_sd(group[0], group[2]),
           fmt::format("mean: less {} in segment {} than elsewhere", to_string(fit.scatter), name));
    }
  }
  if (search_->unknown_wins()) {
    const double gain = search_->best_unknown()->nats - search_->best_known().nats;
    alarm(std::sqrt(2 * gain) + 3,
          fmt::format("mean: scatter by {}", to_string(search_->best_unknown()->scatter)));
  }
  // Slow noise that the catalogue was not asked for, or does not hold.
  const bool slow_accepted = fit.scatter == Scatter::random_walk || fit.scatter == Scatter::flicker;
  const SlowNoise::Best best = slow_.best_both();
  if (!slow_accepted && best.nats > 12) {
    alarm(std::sqrt(2 * best.nats), "spectrum: slow noise inside the dwells");
  }
  test(slow_.jump_sd - 1, "mean: the zero jumps within records");
  test(slow_.axis_sd - 1, "spectrum: wander of one axis inside the dwells");
  test(slow_.misfit_sd, "spectrum: wander inside the dwells");
  // 1/f noise lifts the lowest bins.
  if (!accepted("flicker")) {
    test(response_.noise_left_sd, "spectrum: the noise is not flat");
  }
  // A filter's or mount's form is known to a per cent; what is left within that is no other effect.
  // Truncation, which bends small tones, is in the means' model.
  if ((response_.tone_form_share == 0 || response_.tone_form_share > 0.01) &&
      !accepted("truncation")) {
    test(response_.tone_left_sd, "tone: the amplitude depends on frequency");
  }
  if (step_.usable) {
    // A mount's ringing is known to some per cent of its power; slow noise wanders on after a move.
    const double white2 = std::pow(noise_.white_mg[0], 2);
    const double left =
        accepted("settling")
            ? step_.left_sd - 0.03 * std::max(0.0, step_.left_without_sd)
            : std::max(step_.left_without_sd, step_there_ ? std::sqrt(2 * step_.gain_nats) : 0.0);
    test(left / (1 + 2 * slow_variance_mg2(3) / white2), "transient: the seconds after a move");
  }
  // Tones: quadrature and residuals.
  double chi = 0;
  double freedom = 0;
  for (const ToneFit& tone : tones_) {
    if (!tone.usable || !tone.slips.empty()) {
      continue;
    }
    const Segment& s = bundle_.segments[tone.segment];
    const auto samples = static_cast<double>(tone.samples);
    for (Eigen::Index a = 0; a < 3; ++a) {
      if (a != tone.axis && tone.clipped_share == 0) {
        chi += std::pow(tone.quadrature_mg[a], 2) /
               (2 * noise_.variance_at(static_cast<std::size_t>(a), s.vibration->frequency_hz) /
                samples);
        freedom += 1;
      }
    }
    const auto axis = static_cast<std::size_t>(tone.axis);
    const double rate =
        2 * M_PI * s.vibration->frequency_hz * tone.in_phase_mg[tone.axis] * jitter_s_;
    // Slow noise has few degrees of freedom: it varies by about its own size.
    const double slow = slow_variance_mg2(samples / bundle_.rate_hz);
    double lines_mg2 = 0;
    for (const SpectralLine& line : lines_.lines) {
      lines_mg2 += line.vector_mg.squaredNorm() / 2;
    }
    const double total = noise_total(axis) + slow + lines_mg2 + rate * rate / 2;
    const double z =
        (tone.residual_mg * tone.residual_mg / total - 1) /
        std::sqrt(2 / samples + (jitter_s_ > 0 ? 0.01 : 0) + std::pow(slow / total, 2));
    const bool judged =
        tone.clipped_share == 0 || (jitter_s_ == 0 && !response_.resonance_significant);
    test(!judged                  ? 0
         : accepted("truncation") ? 0
         : jitter_s_ > 0          ? z / 4
                                  : z - 1,
         fmt::format("tone: residual at {} Hz, {} g", s.vibration->frequency_hz,
                     s.vibration->amplitude_g));
    if (tone.clipped_share > 0 && jitter_s_ == 0) {
      const double h = response_.tone_gain(s.vibration->frequency_hz, bundle_.rate_hz);
      const double expected = 1000 * h * s.vibration->amplitude_g *
                              std::abs((s.rotation * s.vibration->direction_lab)[tone.axis]) *
                              search_->best().state.gain[tone.axis];
      // On its flank a resonance is known to its form only.
      const double far = response_.resonance_significant ? 0.5 : 0.03;
      const double off = std::abs(tone.in_phase_mg[tone.axis] / expected - 1);
      test(off > far ? 20 * off / far : 0,
           fmt::format("tone: amplitude of the clipped tone at {} Hz", s.vibration->frequency_hz));
    }
  }
  if (freedom > 0) {
    test(chi_to_sd(chi, freedom), "tone: motion in quadrature across the axes");
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const double ratio = response_.white_mg[a] / kNominalNoise_mg[a];
    // Noise may be born before or behind the gain.
    const double gain = search_->best().state.gain[static_cast<Eigen::Index>(a)];
    const double low = (1 - kNoiseReach) * std::min(1.0, gain);
    const double high = (1 + kNoiseReach) * std::max(1.0, gain);
    // Truncation swallows noise about zero.
    if ((ratio < low && !accepted("truncation")) || ratio > high) {
      alarm(6 + 20 * std::max(low - ratio, ratio - high),
            fmt::format("spectrum: noise of axis {} is {:.2f} times the nominal", "XYZ"[a], ratio));
    }
  }
  judge_codes();
  judge_texture();
}

}  // namespace sixpoint::gap
