#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

void Diagnoser::judge_lines() {
  lines_ = find_lines(bundle_, clean_, noise_);
  std::map<std::string, EffectFinding> by_name;
  // Noise that comes and goes makes lines of its own in the dwells where it is loud.
  if (codes_.spread_sd > 10) {
    std::erase_if(lines_.lines, [](const SpectralLine& line) {
      return line.gain_nats < 60 && line.misfit_sd > 3;
    });
  }
  for (const SpectralLine& line : lines_.lines) {
    const std::string name = line.in_lab ? "floor_vibration" : "electrical_line";
    const std::string other = line.in_lab ? "electrical_line" : "floor_vibration";
    extra_mg2_ += line.vector_mg.squaredNorm() / 6;
    const std::string words = fmt::format("spectrum: a line at {:.2f} Hz, {:.2f} mg",
                                          line.frequency_hz, line.vector_mg.norm());
    if (!allowed(name)) {
      if (line.decidable || !allowed(other)) {
        alarm(std::sqrt(2 * line.gain_nats), words);
        continue;
      }
    }
    const std::string chosen = allowed(name) ? name : other;
    EffectFinding f{chosen, 0, line.gain_nats - 15 + kLogPrior, {}, line.held_out_nats, false, {}};
    f.parameters.push_back({"vector_mg",
                            {line.vector_mg[0], line.vector_mg[1], line.vector_mg[2]},
                            {line.sd_mg, line.sd_mg, line.sd_mg}});
    f.parameters.push_back({"frequency_hz", {line.frequency_hz}, {0.002}});
    if (!line.decidable) {
      f.confounded_with.push_back(other);
    }
    f.nats = std::max(f.nats, kAccept + 0.5);
    if (by_name.count(chosen) == 0) {
      by_name.emplace(chosen, std::move(f));
    }
  }
  for (auto& [name, f] : by_name) {
    find(std::move(f));
  }
}

void Diagnoser::judge_response() {
  ResponseOptions options;
  for (const SpectralLine& line : lines_.lines) {
    options.lines_hz.push_back(line.frequency_hz);
  }
  options.allow_low_pass = allowed("bandwidth");
  options.allow_resonance = allowed("soft_mount");
  // Tones without slips know their amplitude best; where hardly any is whole, all of them.
  const auto whole_ones =
      std::count_if(tones_.begin(), tones_.end(), [](const ToneFit& t) { return t.slips.empty(); });
  std::vector<ToneFit> whole;
  for (const ToneFit& tone : tones_) {
    if (tone.slips.empty() || 2 * whole_ones < std::ssize(tones_)) {
      whole.push_back(tone);
    }
  }
  response_ = find_response(bundle_, noise_, whole, options);
  const double low_nats = response_.low_pass.noise_nats + response_.low_pass.tone_nats;
  if (response_.low_pass_significant) {
    const LowPass& l = response_.low_pass;
    find({"bandwidth",
          0,
          low_nats - 10 + kLogPrior,
          {{"corner_hz", {l.corner_hz}, {std::max(l.corner_sd_hz, 1e-3 * l.corner_hz)}},
           {"order", {static_cast<double>(l.order)}, {}}},
          l.held_out_nats,
          false,
          {}});
    for (const ToneFit& tone : whole) {
      const Segment& s = bundle_.segments[tone.segment];
      const double h = l.tone_gain(s.vibration->frequency_hz, bundle_.rate_hz);
      extra_mg2_ += std::pow(707 * s.vibration->amplitude_g * (1 - h), 2) / 3 /
                    static_cast<double>(bundle_.segments.size());
    }
  } else if (allowed("bandwidth")) {
    find({"bandwidth",
          0,
          std::min(kLogPrior, low_nats - 14 + kLogPrior),
          {{"corner_hz", {response_.low_pass.corner_hz}, {}}},
          0,
          false,
          {}});
  }
  if (response_.has_tones && allowed("soft_mount")) {
    const Resonance& r = response_.resonance;
    const double nats = r.tone_nats - 10 + kLogPrior;
    find({"soft_mount",
          0,
          response_.resonance_significant ? nats : std::min(kLogPrior, nats),
          {{"frequency_hz", {r.frequency_hz}, {0.01 * r.frequency_hz}}, {"q", {r.q}, {0.03 * r.q}}},
          response_.resonance_significant ? r.held_out_nats : 0.0,
          false,
          {}});
    if (response_.resonance_significant) {
      for (const ToneFit& tone : whole) {
        const Segment& s = bundle_.segments[tone.segment];
        extra_mg2_ += std::pow(707 * s.vibration->amplitude_g *
                                   (1 - resonance_gain(s.vibration->frequency_hz, r)),
                               2) /
                      3 / static_cast<double>(bundle_.segments.size());
      }
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    out_.unit.noise_mg[a] = response_.white_mg[a];
  }
}

void Diagnoser::judge_settling() {
  double line_power_mg2 = 0;
  for (const SpectralLine& line : lines_.lines) {
    line_power_mg2 += line.vector_mg.squaredNorm() / 2;
  }
  step_ = step_response(bundle_, clean_, noise_, line_power_mg2);
  if (!step_.usable) {
    return;
  }
  const StepResponse::Mode& mode = step_.mode;
  // Amplitude and phase with a prior of 3 %; frequency and decay among some sixty independent
  // pairs.
  const double sd = std::max(1e-9, mode.amplitude_sd);
  const double relative = sd / std::max(1e-9, mode.amplitude);
  const double nats = step_.gain_nats - 2 * std::log1p(0.03 / sd) - std::log(60.0) + kLogPrior;
  const bool rings = step_.gain_nats > step_.plain_nats + 3;
  EffectFinding f{"settling", 0, nats, {}, 0, false, {}};
  if (nats > kAccept) {
    f.held_out_gain_nats = held_out_step_nats(bundle_, clean_, noise_, line_power_mg2);
  }
  f.parameters.push_back({"amplitude", {step_.amplitude}, {sd}});
  f.parameters.push_back({"frequency_hz",
                          {mode.frequency_hz},
                          {relative / (2 * M_PI * std::max(0.03, mode.decay_s))}});
  f.parameters.push_back({"decay_s", {mode.decay_s}, {2 * relative * mode.decay_s}});
  // A line has a phase of its own in every dwell; what is left of it in their mean rings on at its
  // frequency.
  const bool is_line =
      mode.amplitude < 4.5 * step_.sd &&
      std::any_of(lines_.lines.begin(), lines_.lines.end(), [&](const SpectralLine& line) {
        return std::abs(line.frequency_hz - mode.frequency_hz) < 2.5;
      });
  const bool there = nats > kAccept && !is_line;
  if (there && rings && allowed("settling")) {
    find(std::move(f));
    extra_mg2_ += std::pow(1000 * step_.amplitude, 2) * mode.decay_s / 4 / 10 * 0.6;
  } else {
    if (!there && allowed("settling")) {
      find(std::move(f));
    }
    step_there_ = there;
  }
}

double Diagnoser::noise_total(std::size_t axis) const {
  double sum = 0;
  for (const double v : noise_.variance_mg2[axis]) {
    sum += v;
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, noise_.variance_mg2[axis].size()));
}

}  // namespace sixpoint::gap
