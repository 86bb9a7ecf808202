#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

void Diagnoser::judge_timing() {
  timing_ = host_timing(bundle_);
  ToneOptions tone_options;
  for (std::size_t a = 0; a < 3; ++a) {
    tone_options.noise_mg[a] = std::max(0.5, noise_.white_mg[a]);
  }
  tone_options.clock_ppm = timing_.usable ? timing_.clock_ppm : 0;
  if (timing_.usable && std::abs(timing_.clock_ppm) < 5 * timing_.clock_sd_ppm &&
      timing_.clock_sd_ppm > 20) {
    tone_options.clock_ppm = 0;
  }
  tones_ = fit_tones(bundle_, clean_, tone_options);

  // The clock's rate, from tones: all of them are off by the same share.
  double weight = 0, sum = 0;
  std::size_t tone_samples = 0;
  std::size_t lost = 0, repeated = 0, odd = 0;
  std::size_t lost_at = 0;
  for (const ToneFit& tone : tones_) {
    if (!tone.usable) {
      continue;
    }
    tone_samples += tone.samples;
    for (const Slip& slip : tone.slips) {
      (slip.steps > 0   ? lost
       : slip.steps < 0 ? repeated
                        : odd) += static_cast<std::size_t>(std::max(1, std::abs(slip.steps)));
      lost_at = tone.segment;
    }
    if (tone.slips.empty() && tone.frequency_sd_ppm > 0) {
      const double sd = std::hypot(tone.frequency_sd_ppm, 0.5);
      weight += 1 / (sd * sd);
      sum += clock_of(tone) / (sd * sd);
    }
  }
  const double tone_ppm = weight > 0 ? sum / weight : 0;
  const double tone_sd = weight > 0 ? 1 / std::sqrt(weight) : 1e9;
  double tone_chi = 0;
  double tone_n = 0;
  for (const ToneFit& tone : tones_) {
    if (tone.usable && tone.slips.empty() && tone.frequency_sd_ppm > 0) {
      const double sd = std::hypot(tone.frequency_sd_ppm, 0.5);
      tone_chi += std::pow((clock_of(tone) - tone_ppm) / sd, 2);
      tone_n += 1;
    }
  }
  double ppm = timing_.clock_ppm;
  double sd = timing_.usable ? timing_.clock_sd_ppm : 1e9;
  if (!timing_.usable) {
    ppm = tone_ppm;
    sd = std::max(tone_sd, 1.0);
  } else if (tone_n >= 3) {
    const double apart = std::abs(tone_ppm - ppm) / std::hypot(tone_sd, sd);
    test(apart - 1, "timing: the tones' frequencies are off against the host's clock");
  }
  if (tone_n >= 4 && lost + repeated == 0) {
    test(chi_to_sd(tone_chi, tone_n - 1) - 1,
         "timing: the tones' frequencies contradict each other");
  }
  if (sd < 1e8) {
    // A shaker's or host's own frequency is known to a few ppm; nothing smaller is claimed.
    const double z = ppm / std::hypot(sd, 1.5);
    const double nats =
        0.5 * z * z - std::log(std::max(2.0, 1500 / std::hypot(sd, 1.5))) + kLogPrior;
    double mismatch = 0;
    for (const ToneFit& tone : tones_) {
      const Segment& s = bundle_.segments[tone.segment];
      const double turn = 2 * M_PI * s.vibration->frequency_hz * ppm * 1e-6 *
                          static_cast<double>(s.samples) / bundle_.rate_hz / std::sqrt(12.0);
      mismatch += std::pow(707 * s.vibration->amplitude_g * std::min(1.4, std::abs(turn)), 2);
    }
    if (nats > kAccept) {
      extra_mg2_ +=
          mismatch / std::max<double>(1, static_cast<double>(bundle_.segments.size())) / 3;
    }
    const bool can_be = std::abs(ppm) < 20'000;
    if (!allowed("clock_error") && nats > kAccept) {
      alarm(std::abs(z), fmt::format("timing: the sample clock is off by {:.0f} ppm", ppm));
    } else if (can_be) {
      find({"clock_error",
            0,
            nats,
            {{"ppm", {ppm}, {std::hypot(sd, 1.5)}}},
            timing_.usable ? timing_.clock_held_out_nats : nats - kLogPrior - 1,
            std::abs(ppm) > 200,
            {}});
    }
  }
  // Slips: exact by the host's clock where it has one.
  const bool by_host = timing_.usable && timing_.slips_visible;
  const std::size_t lost_all = by_host ? timing_.lost : lost;
  const std::size_t repeated_all = by_host ? timing_.repeated : repeated;
  const std::size_t looked = by_host ? timing_.samples : tone_samples;
  const auto slips = [&](const char* name, std::size_t count, const char* words) {
    const double rate = share(count, looked);
    // Where every slip would have been seen, none is the answer.
    const double nats = count == 0 ? (by_host ? -9.0 : kLogPrior - 1)
                                   : 12.0 * static_cast<double>(count) + kLogPrior;
    if (count > 0 && !allowed(name)) {
      alarm(30, fmt::format("timing: {} samples {}", count, words));
    } else if (looked > 0) {
      find({name,
            0,
            nats,
            {{"rate",
              {rate},
              {std::sqrt(static_cast<double>(count) + 1) /
               static_cast<double>(std::max<std::size_t>(1, looked))}}},
            nats,
            false,
            {}});
    }
    if (count > 0) {
      extra_mg2_ += rate * 1e6;
    }
  };
  slips("dropped_samples", lost_all, "are missing");
  slips("duplicated_samples", repeated_all, "are there twice");
  if (by_host && tone_samples > 5000 && timing_.lost + timing_.repeated == 0 &&
      lost + repeated > 0) {
    alarm(20, fmt::format("timing: phase steps in tones ({}) without slips on the host's clock",
                          bundle_.segments[lost_at].name));
  }
  if (odd > 0 && lost_all + repeated_all == 0) {
    alarm(15, fmt::format("timing: {} phase steps in tones that are no whole sample", odd));
  }
  judge_jitter();
  codes_ = code_statistics(bundle_, clean_);
}

void Diagnoser::judge_jitter() {
  double up = 0, down = 0;
  std::size_t n = 0;
  for (const ToneFit& tone : tones_) {
    if (!tone.usable || !tone.slips.empty() || tone.samples < 200) {
      continue;
    }
    const Segment& s = bundle_.segments[tone.segment];
    const double rate = 2 * M_PI * s.vibration->frequency_hz * tone.in_phase_mg[tone.axis];  // mg/s
    const double white =
        noise_.variance_at(static_cast<std::size_t>(tone.axis), s.vibration->frequency_hz);
    // slope - crest = (rate * jitter)^2 / 2; either scatters by variance * sqrt(3/n) about.
    const double level = std::max(white, tone.residual_mg * tone.residual_mg);
    const double sd = level * std::sqrt(4.0 / static_cast<double>(tone.samples));
    const double lever = 0.5 * rate * rate;
    up += lever * (tone.on_slope_mg2 - tone.on_crest_mg2) / (sd * sd);
    down += lever * lever / (sd * sd);
    ++n;
  }
  if (n == 0) {
    return;
  }
  const double variance = up / down;
  const double z = up / std::sqrt(down);
  const double jitter_ms = 1e3 * std::sqrt(std::max(0.0, variance));
  const double sd_ms = jitter_ms > 0 ? 1e3 / std::sqrt(down) / (2 * jitter_ms / 1e3) : 0.05;
  const double nats = (z > 0 ? 0.5 * z * z : 0) - 4 + kLogPrior;
  if (nats > kAccept) {
    if (allowed("jitter")) {
      jitter_s_ = jitter_ms / 1e3;
      find({"jitter",
            0,
            nats,
            {{"rms_ms", {jitter_ms}, {std::min(sd_ms, jitter_ms)}}},
            nats - kLogPrior,
            false,
            {}});
      for (ToneFit& tone : tones_) {
        const double f =
            2 * M_PI * bundle_.segments[tone.segment].vibration->frequency_hz * jitter_s_;
        tone.in_phase_mg *= std::exp(f * f / 2);
        extra_mg2_ += std::pow(f * tone.in_phase_mg[tone.axis], 2) / 2 / 3 /
                      static_cast<double>(bundle_.segments.size());
      }
    } else {
      alarm(z, "timing: scatter on the slopes of the tones");
    }
  } else {
    find({"jitter", 0, nats, {{"rms_ms", {jitter_ms}, {sd_ms}}}, nats - kLogPrior, false, {}});
  }
}

}  // namespace sixpoint::gap
