#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// What is subtracted from a test because small effects of the catalogue or heavy tails add to it.
constexpr double kSlowChance_sd = 1;
// Slow noise that is not accepted is an alarm from here on: e^12 is 160,000 to one.
constexpr double kSlowNoise_nats = 12;
constexpr double kUnknownScatter_sd = 3;  // added to an unknown scatter's own
// The form of a filter or mount is known to one per cent: within that nothing else is concluded.
constexpr double kKnownForm = 0.01;

// Chi-square of the means, as a whole and by segments.
void test_means(const Request& request, const Explanation& explanation, bool truncated,
                Findings& found) {
  const Fit& fit = explanation.best();
  found.test(chi_to_sd(fit.residual.squaredNorm(), explanation.model().freedom_of(fit)),
             "mean: dwells and tones together");
  struct Group {
    double chi = 0, rows = 0, freedom = 0;
  };
  std::map<std::string, Group> groups;
  const std::vector<double> freedom = explanation.row_freedom();
  for (Eigen::Index row = 0; row < fit.residual.size(); ++row) {
    const Block& block = explanation.model().block_of_row(row);
    Group& group = groups[request.bundle.segments[block.segment].name];
    group.chi += fit.residual[row] * fit.residual[row];
    group.rows += 1;
    group.freedom += freedom[static_cast<std::size_t>(row)];
  }
  // Random scatter has its size in every part of the recording: too little of it counts as too much
  // does.
  const bool scattered = fit.scatter != Scatter::nominal && in_catalogue(fit.scatter);
  for (const auto& [name, group] : groups) {
    // Tones of five samples a period meet a truncated zero at five phases only.
    if (truncated && name.rfind("shaker", 0) == 0) {
      continue;
    }
    found.test(chi_to_sd(group.chi, group.rows), fmt::format("mean: segment {}", name));
    if (scattered) {
      found.test(
          -chi_to_sd(group.chi, group.freedom),
          fmt::format("mean: less {} in segment {} than elsewhere", to_string(fit.scatter), name));
    }
  }
}

// Noise behind a low corner may be so small that rounding is no noise of its own any more: it
// follows the signal, and its spectrum is not flat. Above 0.6 counts rms it nearly is (Widrow and
// Kollar, Quantization Noise, 2008, ch. 4).
bool is_below_rounding(const Request& request, const Response& response) {
  constexpr double kLeast_lsb = 0.6;
  constexpr int kSteps = 64;
  const double rate_hz = request.bundle.rate_hz;
  double kept = 0;
  for (int i = 0; i < kSteps; ++i) {
    kept += std::pow(response.noise_gain((i + 0.5) / kSteps * rate_hz / 2, rate_hz), 2) / kSteps;
  }
  const double least_mg = 1e3 * kLeast_lsb / request.bundle.accel_scale_lsb_per_g / std::sqrt(kept);
  return std::ranges::any_of(response.white_mg, [&](double white) { return white < least_mg; });
}

// Slow noise and the noise's spectrum.
void test_spectrum(const Request& request, const Records& records, const Explanation& explanation,
                   const Findings& before, Findings& found) {
  found.suspect(explanation.unknown_nats());
  if (explanation.unknown_wins()) {
    const double gain = explanation.best_unknown()->nats - explanation.best_known().nats;
    found.alarm(nats_to_sd(gain) + kUnknownScatter_sd,
                fmt::format("mean: scatter by {}", to_string(explanation.best_unknown()->scatter)));
  }
  const SlowNoise& slow = records.slow;
  const Scatter scatter = explanation.best().scatter;
  const double nats = slow.best().nats;
  if (scatter != Scatter::random_walk && scatter != Scatter::flicker && nats > kSlowNoise_nats) {
    found.alarm(nats_to_sd(nats), "spectrum: slow noise inside the dwells");
  }
  found.test(slow.jump_sd - kSlowChance_sd, "mean: the zero jumps within records");
  found.test(slow.axis_sd - kSlowChance_sd, "spectrum: wander of one axis inside the dwells");
  found.test(slow.misfit_sd, "spectrum: wander inside the dwells");
  const Response& response = records.response;
  // 1/f noise lifts the lowest bins.
  if (!before.accepted("flicker") &&
      !(before.accepted("bandwidth") && is_below_rounding(request, response))) {
    found.test(response.noise_left_sd, "spectrum: the noise is not flat", noise_places(request));
  }
  // Truncation, which bends small tones, is in the model of the means.
  if ((response.tone_form_share == 0 || response.tone_form_share > kKnownForm) &&
      !before.accepted("truncation")) {
    found.test(response.tone_left_sd, "tone: the amplitude depends on frequency");
  }
}

// The seconds after a move. `slow_mg2`: variance of slow noise in them.
void test_settling(const Records& records, double slow_mg2, bool accepted, Findings& found) {
  const StepResponse& step = records.settling.step;
  if (!step.usable) {
    return;
  }
  const double white2 = std::pow(records.noise.white_mg[0], 2);
  const double left =
      accepted ? step.left_sd - kKnownRinging * std::max(0.0, step.left_without_sd)
               : std::max(step.left_without_sd,
                          records.settling.unexplained ? nats_to_sd(step.gain_nats) : 0.0);
  found.test(left / (1 + 2 * slow_mg2 / white2), "transient: the seconds after a move");
}

// Residual of one tone against noise, slow noise (`slow_mg2`), lines and jitter.
void test_tone_residual(const Request& request, const Records& records, const ToneFit& tone,
                        double slow_mg2, bool truncated, Findings& found) {
  const Vibration& vibration = *request.bundle.segments[tone.segment].vibration;
  const bool jitter = records.jitter_s > 0;
  const bool judged = !truncated && (tone.clipped_share == 0 ||
                                     (!jitter && !records.response.resonance_significant));
  if (!judged) {
    return;
  }
  const std::vector<double>& noise =
      records.noise.variance_mg2[static_cast<std::size_t>(tone.axis)];
  double noise_mg2 = 0;
  for (const double v : noise) {
    noise_mg2 += v;
  }
  noise_mg2 /= static_cast<double>(std::max<std::size_t>(1, noise.size()));
  const double rate =
      2 * M_PI * vibration.frequency_hz * tone.in_phase_mg[tone.axis] * records.jitter_s;
  const double total = noise_mg2 + slow_mg2 + records.lines.power_mg2 + rate * rate / 2;
  // Relative variance that accepted jitter is known to, and how much its test counts.
  constexpr double kJitterVariance = 0.01, kJitterTests = 4;
  // Slow noise has few degrees of freedom: it varies by about its own size.
  const double z = (tone.residual_mg * tone.residual_mg / total - 1) /
                   std::sqrt(2 * records.response.correlated_samples(request.bundle.rate_hz) /
                                 static_cast<double>(tone.samples) +
                             (jitter ? kJitterVariance : 0) + std::pow(slow_mg2 / total, 2));
  found.test(
      jitter ? z / kJitterTests : z - kSlowChance_sd,
      fmt::format("tone: residual at {} Hz, {} g", vibration.frequency_hz, vibration.amplitude_g),
      {{tone.axis, request.bundle.segments[tone.segment].name, "frequency"}});
}

// Amplitude of a clipped tone, which is not among the means. `gain`: of its axis.
void test_clipped_tone(const Request& request, const Records& records, const ToneFit& tone,
                       double gain, Findings& found) {
  const Segment& s = request.bundle.segments[tone.segment];
  const double h = records.response.tone_gain(s.vibration->frequency_hz, request.bundle.rate_hz);
  const double expected_mg = 1000 * h * s.vibration->amplitude_g *
                             std::abs((s.rotation * s.vibration->direction_lab)[tone.axis]) * gain;
  // Known to this share; an alarm grows by 20 sd for each time that it is off by that.
  constexpr double kFar = 0.03;
  constexpr double kAlarm_sd_per_share = 20;
  const double off = std::abs(tone.in_phase_mg[tone.axis] / expected_mg - 1);
  found.test(off > kFar ? kAlarm_sd_per_share * off / kFar : 0,
             fmt::format("tone: amplitude of the clipped tone at {} Hz", s.vibration->frequency_hz),
             {{tone.axis, s.name, "amplitude"}});
}

void test_tones(const Request& request, const Records& records, const Fit& fit,
                const Findings& before, Findings& found) {
  double chi = 0;
  double freedom = 0;
  for (const ToneFit& tone : records.tones) {
    if (!tone.usable || !tone.slips.empty()) {
      continue;
    }
    const double frequency_hz = request.bundle.segments[tone.segment].vibration->frequency_hz;
    const auto samples = static_cast<double>(tone.samples);
    for (Eigen::Index a = 0; a < 3; ++a) {
      if (a != tone.axis && tone.clipped_share == 0) {
        chi += std::pow(tone.quadrature_mg[a], 2) /
               (2 * records.noise.variance_at(static_cast<std::size_t>(a), frequency_hz) / samples +
                tone.line_mg2[0][a]);
        freedom += 1;
      }
    }
    test_tone_residual(
        request, records, tone,
        slow_variance_mg2(fit, before, samples / request.bundle.rate_hz, request.bundle.rate_hz),
        before.accepted("truncation"), found);
    // Most of a tone that a resonance lifts is clipped: what is left does not tell its amplitude.
    if (tone.clipped_share > 0 && records.jitter_s == 0 &&
        !records.response.resonance_significant) {
      test_clipped_tone(request, records, tone, fit.state.gain[tone.axis], found);
    }
  }
  if (freedom > 0) {
    found.test(chi_to_sd(chi, freedom), "tone: motion in quadrature across the axes");
  }
}

void test_noise(const Request& request, const Response& response, const Fit& fit, bool truncated,
                Findings& found) {
  constexpr double kReach = 0.13;  // the nominal noise within 10 %, the error of its estimate added
  constexpr double kAtLimit_sd = 6, kPerShare_sd = 20;  // alarm
  for (std::size_t a = 0; a < 3; ++a) {
    const double nominal_mg =
        kNominalNoise_mg[a] * std::sqrt(request.bundle.rate_hz / kNominalNoiseAt_hz);
    const double ratio = response.white_mg[a] / nominal_mg;
    // Noise may arise before or behind the gain.
    const double gain = fit.state.gain[static_cast<Eigen::Index>(a)];
    const double low = (1 - kReach) * std::min(1.0, gain);
    const double high = (1 + kReach) * std::max(1.0, gain);
    // Truncation reduces noise about zero.
    if ((ratio < low && !truncated) || ratio > high) {
      found.alarm(
          kAtLimit_sd + kPerShare_sd * std::max(low - ratio, ratio - high),
          fmt::format("spectrum: noise of axis {} is {:.2f} times the nominal", "XYZ"[a], ratio),
          noise_places(request, static_cast<int>(a)));
    }
  }
}

}  // namespace

double slow_variance_mg2(const Fit& fit, const Findings& found, double seconds, double rate_hz) {
  if (fit.scatter == Scatter::flicker && found.accepted("flicker")) {
    // A density of F^2 / f between one period in this time and half the rate.
    return flicker_density_mg2(fit.scatter_size) * std::log(seconds * rate_hz / 2);
  }
  if (fit.scatter == Scatter::random_walk && found.accepted("random_walk")) {
    return fit.scatter_size * fit.scatter_size * seconds / 6;  // of a walk less its mean
  }
  return 0;
}

Findings judge_left_over(const Request& request, const Records& records,
                         const Explanation& explanation, const Findings& before) {
  Findings found;
  const Fit& fit = explanation.best();
  const bool truncated = before.accepted("truncation");
  const auto slow_mg2 = [&](double seconds) {
    return slow_variance_mg2(fit, before, seconds, request.bundle.rate_hz);
  };
  test_means(request, explanation, truncated, found);
  test_spectrum(request, records, explanation, before, found);
  // Slow noise adds to the response to a move over three seconds, to a dwell's variance over seven.
  test_settling(records, slow_mg2(3), before.accepted("settling"), found);
  test_tones(request, records, fit, before, found);
  test_noise(request, records.response, fit, truncated, found);
  found.append(judge_codes(request, records, slow_mg2(7), before));
  found.append(judge_texture(request, records, before));
  return found;
}

}  // namespace sixpoint::gap
