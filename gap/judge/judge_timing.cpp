#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// Uncertainties beside the statistical ones (conventions): of a tone's frequency, and of the host's
// clock or the shaker's oscillator, which are known to a few ppm.
constexpr double kToneFloor_ppm = 0.5;
constexpr double kClockFloor_ppm = 1;
// Prior ranges of a clock's error: of every crystal, and of one that is wrong. Even odds.
constexpr double kCrystal_ppm = 40;
constexpr double kClockRange_ppm = 1500;
constexpr double kPossibleClock_ppm = 20'000;
constexpr double kDatasheetClock_ppm = 200;  // also in the catalogue
constexpr double kNoClock_ppm = 1e9;         // uncertainty where nothing shows it
constexpr double kClockChance_sd = 1;        // what small effects of the catalogue add to a test
constexpr double kRmsPerG_mg = 707;          // of a sine of 1 g

// Slips (conventions): evidence of one, odds of none where each would show, alarms.
constexpr double kPerSlip_nats = 12;
constexpr double kNoSlip_nats = -9;
constexpr double kSlipAlarm_sd = 30;
constexpr double kPhaseStepAlarm_sd = 20;
constexpr double kOddStepAlarm_sd = 15;
// Samples are lost one by one or a few together; runs that are longer have another cause.
constexpr double kLongRun = 6;
constexpr double kLongRunAlarm_sd = 15;
constexpr std::size_t kEnoughSamples = 5000;

// What the tones say of the clock.
struct ToneClock {
  double ppm = 0, sd_ppm = kNoClock_ppm;
  double chi = 0, count = 0;  // about the mean
  std::size_t samples = 0;
  std::size_t lost = 0, repeated = 0;
  std::size_t odd = 0;  // steps that are no whole number of samples
  std::size_t slip_segment = 0;
};

bool shows_clock(const ToneFit& tone) {
  return tone.usable && tone.slips.empty() && tone.frequency_sd_ppm > 0;
}

ToneClock tone_clock(const std::vector<ToneFit>& tones) {
  ToneClock clock;
  double weight = 0, sum = 0;
  for (const ToneFit& tone : tones) {
    if (!tone.usable) {
      continue;
    }
    clock.samples += tone.samples;
    for (const Slip& slip : tone.slips) {
      (slip.steps > 0   ? clock.lost
       : slip.steps < 0 ? clock.repeated
                        : clock.odd) += static_cast<std::size_t>(std::max(1, std::abs(slip.steps)));
      clock.slip_segment = tone.segment;
    }
    if (shows_clock(tone)) {
      const double sd = std::hypot(tone.frequency_sd_ppm, kToneFloor_ppm);
      weight += 1 / (sd * sd);
      sum += clock_ppm_of(tone) / (sd * sd);
    }
  }
  if (weight > 0) {
    clock.ppm = sum / weight;
    clock.sd_ppm = 1 / std::sqrt(weight);
  }
  for (const ToneFit& tone : tones) {
    if (shows_clock(tone)) {
      const double sd = std::hypot(tone.frequency_sd_ppm, kToneFloor_ppm);
      clock.chi += std::pow((clock_ppm_of(tone) - clock.ppm) / sd, 2);
      clock.count += 1;
    }
  }
  return clock;
}

ToneOptions tone_options(const NoiseSpectrum& noise, const HostTiming& host, const Lines& lines) {
  // A rate that is neither significant nor known well is better left out.
  constexpr double kSignificant_sd = 5;
  constexpr double kKnown_ppm = 20;
  constexpr double kLeastNoise_mg = 0.5;
  ToneOptions options;
  options.lines = lines.list;
  for (std::size_t a = 0; a < 3; ++a) {
    options.noise_mg[a] = std::max(kLeastNoise_mg, noise.white_mg[a]);
  }
  const bool vague = std::abs(host.clock_ppm) < kSignificant_sd * host.clock_sd_ppm &&
                     host.clock_sd_ppm > kKnown_ppm;
  options.clock_ppm = host.usable && !vague ? host.clock_ppm : 0;
  return options;
}

// Mean square that a clock error adds to the tones within a packet of one second, whose time the
// host knows: it turns their phase by at most a full swing.
double clock_gap_mg2(const Request& request, const std::vector<ToneFit>& tones, double ppm) {
  constexpr double kMostTurn = 1.4;  // of the swing: two sines without a common phase
  double mismatch = 0;
  for (const ToneFit& tone : tones) {
    const Segment& s = request.bundle.segments[tone.segment];
    const double seconds = std::min(1.0, static_cast<double>(s.samples) / request.bundle.rate_hz);
    const double turn =
        2 * M_PI * s.vibration->frequency_hz * ppm * 1e-6 * seconds / std::sqrt(12.0);
    mismatch +=
        std::pow(kRmsPerG_mg * s.vibration->amplitude_g * std::min(kMostTurn, std::abs(turn)), 2);
  }
  return mismatch / std::max<double>(1, request.segments()) / 3;
}

void judge_clock(const Request& request, const HostTiming& host, const std::vector<ToneFit>& tones,
                 const ToneClock& by_tones, Findings& found) {
  double ppm = host.clock_ppm;
  double sd = host.clock_sd_ppm;
  if (!host.usable) {
    ppm = by_tones.ppm;
    sd = std::max(by_tones.sd_ppm, 1.0);
  } else if (by_tones.count >= 3) {
    found.test(std::abs(by_tones.ppm - ppm) / std::hypot(by_tones.sd_ppm, sd) - kClockChance_sd,
               "timing: the tones' frequencies are off against the host's clock");
  }
  if (by_tones.count >= 4 && by_tones.lost + by_tones.repeated == 0) {
    found.test(chi_to_sd(by_tones.chi, by_tones.count - 1) - kClockChance_sd,
               "timing: the tones' frequencies contradict each other");
  }
  if (sd >= 0.1 * kNoClock_ppm) {
    return;
  }
  const double known_ppm = std::hypot(sd, kClockFloor_ppm);
  const double z = ppm / known_ppm;
  const auto range_nats = [&](double range_ppm) {
    const double wide2 = 1 + std::pow(range_ppm / known_ppm, 2);
    return 0.5 * z * z * (1 - 1 / wide2) - 0.5 * std::log(wide2);
  };
  const double crystal = range_nats(kCrystal_ppm);
  const double wrong = range_nats(kClockRange_ppm);
  const double nats = std::max(crystal, wrong) + std::log1p(std::exp(-std::abs(crystal - wrong))) -
                      std::log(2.0) + kLogPriorEffect;
  const double gap_mg2 = nats > kAccept_nats ? clock_gap_mg2(request, tones, ppm) : 0;
  found.outside_means.push_back({"clock_error", gap_mg2});
  if (!request.allowed("clock_error") && nats > kAccept_nats) {
    found.alarm(std::abs(z), fmt::format("timing: the sample clock is off by {:.0f} ppm", ppm));
  } else if (std::abs(ppm) < kPossibleClock_ppm) {
    found.add(request, {.name = "clock_error",
                        .nats = nats,
                        .parameters = {{"ppm", {ppm}, {known_ppm}}},
                        .held_out_gain_nats =
                            host.usable ? host.clock_held_out_nats : nats - kLogPriorEffect - 1,
                        .outside_datasheet = std::abs(ppm) > kDatasheetClock_ppm,
                        .gap_mg2 = gap_mg2});
    found.bounds["clock_error"] = known_ppm * std::sqrt(2 * (kAccept_nats + 0.5 * z * z - nats));
  }
}

// How many samples are lost (or repeated) together, each sample counted once: the mean square of a
// packet's number over its mean, less what meets in one packet by chance. One by one: 1.
double run_length(const HostTiming& host, bool missing) {
  double sum = 0;
  double squares = 0;
  for (const ClockSlip& slip : host.slips) {
    if ((slip.lost > 0) == missing) {
      sum += std::abs(slip.lost);
      squares += static_cast<double>(slip.lost) * slip.lost;
    }
  }
  return sum > 0 ? squares / sum - sum / static_cast<double>(host.packets) : 0;
}

// Lost and repeated samples: exact by the host's clock where it shows them, else by the tones.
void judge_slips(const Request& request, const HostTiming& host, const ToneClock& by_tones,
                 Findings& found) {
  const bool by_host = host.usable && host.slips_visible;
  const std::size_t samples = by_host ? host.samples : by_tones.samples;
  const std::size_t lost = by_host ? host.lost : by_tones.lost;
  const std::size_t repeated = by_host ? host.repeated : by_tones.repeated;
  const auto judge = [&](const char* name, bool missing) {
    const std::size_t count = missing ? lost : repeated;
    const char* words = missing ? "are missing" : "are there twice";
    const double rate = share_of(count, samples);
    const double nats = count == 0 ? (by_host ? kNoSlip_nats : kLogPriorEffect - 1)
                                   : kPerSlip_nats * static_cast<double>(count) + kLogPriorEffect;
    const double gap_mg2 = rate * 1e6;  // 1 g rms for each sample out of place
    found.outside_means.push_back({name, gap_mg2});
    if (count > 0 && !request.allowed(name)) {
      found.alarm(kSlipAlarm_sd, fmt::format("timing: {} samples {}", count, words));
    } else if (samples > 0) {
      const double sd =
          std::sqrt(static_cast<double>(count) + 1) / static_cast<double>(samples);  // Poisson
      found.add(request, {.name = name,
                          .nats = nats,
                          .parameters = {{"rate", {rate}, {sd}}},
                          .held_out_gain_nats = nats,
                          .gap_mg2 = gap_mg2});
    }
    const double together = by_host ? run_length(host, missing) : 0;
    if (together > kLongRun) {
      found.alarm(kLongRunAlarm_sd,
                  fmt::format("timing: samples {}, about {:.0f} together", words, together));
    }
  };
  judge("dropped_samples", true);
  judge("duplicated_samples", false);
  if (samples > 0) {
    // Each shows: half of the recordings have one or more where the mean number is log 2.
    found.bounds["dropped_samples"] = found.bounds["duplicated_samples"] =
        std::numbers::ln2 / static_cast<double>(samples);
  }
  if (by_host && by_tones.samples > kEnoughSamples && lost + repeated == 0 &&
      by_tones.lost + by_tones.repeated > 0) {
    found.alarm(kPhaseStepAlarm_sd,
                fmt::format("timing: phase steps in tones ({}) without slips on the host's clock",
                            request.bundle.segments[by_tones.slip_segment].name));
  }
  if (by_tones.odd > 0 && lost + repeated == 0) {
    found.alarm(
        kOddStepAlarm_sd,
        fmt::format("timing: {} phase steps in tones that are no whole sample", by_tones.odd));
  }
}

// Variance of the sample times by weighted least squares over the tones. A tone of amplitude A and
// angular frequency w, sampled at times that scatter by s, is found with the amplitude B =
// A exp(-(w s)^2 / 2). The residual's excess on the slopes over that on the crests is
// B^2 / 2 (1 - exp(-(w s)^2)): for small ones (w B s)^2 / 2.
struct JitterTone {
  double w = 0;           // rad/s
  double found_mg = 0;    // B
  double excess_mg2 = 0;  // of the slopes over the crests
  double white_mg2 = 0;
  double residual_mg2 = 0;
  double samples = 0;
};
struct JitterSums {
  double up = 0;    // per s^2
  double down = 0;  // per s^4
  std::vector<JitterTone> tones = {};
};

JitterSums jitter_sums(const Request& request, const std::vector<ToneFit>& tones,
                       const NoiseSpectrum& noise) {
  constexpr std::size_t kLeastSamples = 200;
  JitterSums sums;
  for (const ToneFit& tone : tones) {
    const bool whole_steps =
        std::ranges::all_of(tone.slips, [](const Slip& slip) { return slip.steps != 0; });
    if (!tone.usable || !whole_steps || tone.samples_apart < kLeastSamples) {
      continue;
    }
    const auto samples = static_cast<double>(tone.samples_apart);
    const double frequency_hz = request.bundle.segments[tone.segment].vibration->frequency_hz;
    const double rate = 2 * M_PI * frequency_hz * tone.in_phase_mg[tone.axis];  // mg/s
    const double white = noise.variance_at(static_cast<std::size_t>(tone.axis), frequency_hz);
    const double level = std::max(white, tone.residual_mg * tone.residual_mg);
    const double sd = level * std::sqrt(4.0 / samples);
    const double lever = 0.5 * rate * rate;
    sums.tones.push_back({2 * M_PI * frequency_hz, tone.in_phase_mg[tone.axis],
                          tone.on_slope_mg2 - tone.on_crest_mg2, white,
                          tone.residual_mg * tone.residual_mg, samples});
    sums.up += lever * (tone.on_slope_mg2 - tone.on_crest_mg2) / (sd * sd);
    sums.down += lever * lever / (sd * sd);
  }
  return sums;
}

struct JitterFit {
  double ms = 0;
  double sd_ms = 0;
};

// The size, by the exact law. A tone's weight is that of the scatter which the size lets expect, and
// not of its own residuals: what is large by chance would weigh less, and the size be too small by a
// hundredth. A tone that has much more than that has another cause, too, and weighs less.
JitterFit fit_jitter(const JitterSums& sums) {
  constexpr int kRounds = 20;  // each takes the error down by (w s)^2 / 2 and more
  constexpr double kMuchMore = 1.5;
  constexpr double kNoJitterSd_ms = 0.05;
  double variance_s2 = std::max(0.0, sums.up / sums.down);
  double down = sums.down;
  for (int round = 0; round < kRounds && variance_s2 > 0; ++round) {
    double up = 0;
    down = 0;
    for (const JitterTone& tone : sums.tones) {
      const double x = tone.w * tone.w * variance_s2;
      const double half_mg2 = tone.found_mg * tone.found_mg / 2;
      const double slope = half_mg2 * -std::expm1(-x) / variance_s2;  // mg^2/s^2
      double added_mg2 = half_mg2 * std::expm1(x);                    // to the mean square
      if (tone.residual_mg2 > kMuchMore * (tone.white_mg2 + added_mg2)) {
        added_mg2 = tone.residual_mg2 - tone.white_mg2;
      }
      // (8 / n) times the mean over the phases p of cos^2 2p (white + 2 added sin^2 p)^2, of
      // normal residuals: cos^2 2p has the mean 1/2, times sin^2 p 1/4, times sin^4 p 7/32.
      const double level_mg2 = tone.white_mg2 + added_mg2;
      const double variance =
          (level_mg2 * level_mg2 + 0.75 * added_mg2 * added_mg2) * 4 / tone.samples;
      up += slope * tone.excess_mg2 / variance;
      down += slope * slope / variance;
    }
    variance_s2 = std::max(0.0, up / down);
  }
  JitterFit fit{.ms = 1e3 * std::sqrt(variance_s2)};
  fit.sd_ms = fit.ms > 0 ? 1e6 / std::sqrt(down) / (2 * fit.ms) : kNoJitterSd_ms;
  return fit;
}

// The jitter, in ms, whose z in jitter_sums() is expected to be this: what it adds to a residual
// makes that less sure.
double jitter_of_z(const std::vector<JitterTone>& tones, double z) {
  double low_s2 = 0, high_s2 = 1;
  for (int halving = 0; halving < 80; ++halving) {
    const double variance_s2 = (low_s2 + high_s2) / 2;
    double down = 0;
    for (const JitterTone& tone : tones) {
      const double lever = 0.5 * std::pow(tone.w * tone.found_mg, 2);
      const double level = tone.white_mg2 + lever * variance_s2;
      down += std::pow(lever / level, 2) * tone.samples / 4;
    }
    (variance_s2 * std::sqrt(down) < z ? low_s2 : high_s2) = variance_s2;
  }
  return 1e3 * std::sqrt(high_s2);
}

// Adds accepted jitter to `timing`, and frees the tones' amplitudes of what it takes off.
void judge_jitter(const Request& request, const NoiseSpectrum& noise, Timing& timing) {
  constexpr double kCost_nats = 4;  // convention: of its size, and of heavy tails
  const JitterSums sums = jitter_sums(request, timing.tones, noise);
  if (sums.down == 0) {
    return;
  }
  const double z = sums.up / std::sqrt(sums.down);
  const auto [jitter_ms, sd_ms] = fit_jitter(sums);
  const double nats = (z > 0 ? 0.5 * z * z : 0) - kCost_nats + kLogPriorEffect;
  const bool there = nats > kAccept_nats;
  timing.found.bounds["jitter"] =
      jitter_of_z(sums.tones, std::sqrt(2 * (kAccept_nats + kCost_nats - kLogPriorEffect)));
  if (there && !request.allowed("jitter")) {
    timing.found.alarm(z, "timing: scatter on the slopes of the tones");
    return;
  }
  if (there) {
    timing.jitter_s = jitter_ms / 1e3;
  }
  double gap_mg2 = 0;
  for (ToneFit& tone : timing.tones) {
    const double f =
        2 * M_PI * request.bundle.segments[tone.segment].vibration->frequency_hz * timing.jitter_s;
    tone.in_phase_mg *= std::exp(f * f / 2);
    gap_mg2 += std::pow(f * tone.in_phase_mg[tone.axis], 2) / 2 / 3 / request.segments();
  }
  timing.found.outside_means.push_back({"jitter", gap_mg2});
  timing.found.add(
      request,
      {.name = "jitter",
       .nats = nats,
       .parameters = {{"rms_ms", {jitter_ms}, {there ? std::min(sd_ms, jitter_ms) : sd_ms}}},
       .held_out_gain_nats = nats - kLogPriorEffect,
       .gap_mg2 = gap_mg2});
}

}  // namespace

double clock_ppm_of(const ToneFit& tone) { return 1e6 * (1 / (1 + 1e-6 * tone.frequency_ppm) - 1); }

Timing judge_timing(const Request& request, const CleanSamples& clean, const NoiseSpectrum& noise,
                    const Lines& lines) {
  Timing timing;
  timing.host = host_timing(request.bundle);
  timing.tones = fit_tones(request.bundle, clean, tone_options(noise, timing.host, lines));
  const ToneClock by_tones = tone_clock(timing.tones);
  judge_clock(request, timing.host, timing.tones, by_tones, timing.found);
  judge_slips(request, timing.host, by_tones, timing.found);
  judge_jitter(request, noise, timing);
  return timing;
}

}  // namespace sixpoint::gap
