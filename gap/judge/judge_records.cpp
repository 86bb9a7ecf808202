#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// What the search among frequencies, corners or frequencies with decays costs (conventions, set so
// that `gap challenge --none 1` finds none).
constexpr double kResponseCost_nats = 10;
constexpr double kNoLowPassCost_nats = 14;  // where the corner is not significant
// Relative uncertainties of a resonance's and a filter's parameters: how far their forms differ.
constexpr double kResonanceFrequency = 0.01;
constexpr double kResonanceQ = 0.03;
constexpr double kCorner = 1e-3;

// Mean square per axis that a gain of `h` instead of 1 adds to a tone.
double tone_gap_mg2(const Request& request, const Segment& segment, double h) {
  constexpr double kRmsPerG_mg = 707;
  return std::pow(kRmsPerG_mg * segment.vibration->amplitude_g * (1 - h), 2) / 3 /
         request.segments();
}

// Tones without slips know their amplitude best. If most have slips, those count that leave little:
// the amplitude of a tone whose slips were not all found is wrong. If most leave much, all count.
std::vector<ToneFit> whole_tones(const std::vector<ToneFit>& tones) {
  constexpr double kMissedSlip = 0.15;  // of the amplitude: a slip a sample off leaves 5 %
  const auto without_slips = [](const ToneFit& tone) { return tone.slips.empty(); };
  const auto leaves_little = [](const ToneFit& tone) {
    return tone.residual_mg < kMissedSlip * tone.in_phase_mg[tone.axis];
  };
  const auto most_that = [&](const auto& is_good) {
    std::vector<ToneFit> good;
    std::ranges::copy_if(tones, std::back_inserter(good), is_good);
    return 2 * good.size() < tones.size() ? std::vector<ToneFit>{} : good;
  };
  if (auto whole = most_that(without_slips); !whole.empty()) {
    return whole;
  }
  auto found = most_that(leaves_little);
  return found.empty() ? tones : found;
}

void judge_low_pass(const Request& request, const Response& response,
                    const std::vector<ToneFit>& tones, Findings& found) {
  const LowPass& l = response.low_pass;
  const double gain_nats = l.noise_nats + l.tone_nats;
  if (!response.low_pass_significant) {
    found.add(request,
              {.name = "bandwidth",
               .nats = std::min(kLogPriorEffect, gain_nats - kNoLowPassCost_nats + kLogPriorEffect),
               .parameters = {{"corner_hz", {l.corner_hz}, {}}}});
    return;
  }
  double gap_mg2 = 0;
  for (const ToneFit& tone : tones) {
    const Segment& s = request.bundle.segments[tone.segment];
    const double h = l.tone_gain(s.vibration->frequency_hz, request.bundle.rate_hz);
    gap_mg2 += tone_gap_mg2(request, s, h);
  }
  found.outside_means.push_back({"bandwidth", gap_mg2});
  found.add(request, {.name = "bandwidth",
                      .nats = gain_nats - kResponseCost_nats + kLogPriorEffect,
                      .parameters = {{"corner_hz",
                                      {l.corner_hz},
                                      {std::max(l.corner_sd_hz, kCorner * l.corner_hz)}},
                                     {"order", {static_cast<double>(l.order)}, {}}},
                      .held_out_gain_nats = l.held_out_nats,
                      .gap_mg2 = gap_mg2});
}

void judge_resonance(const Request& request, const Response& response,
                     const std::vector<ToneFit>& tones, Findings& found) {
  const Resonance& r = response.resonance;
  const bool there = response.resonance_significant;
  const double nats = r.tone_nats - kResponseCost_nats + kLogPriorEffect;
  double gap_mg2 = 0;
  for (const ToneFit& tone : tones) {
    const Segment& s = request.bundle.segments[tone.segment];
    gap_mg2 += there ? tone_gap_mg2(request, s, resonance_gain(s.vibration->frequency_hz, r)) : 0;
  }
  found.outside_means.push_back({"soft_mount", gap_mg2});
  found.add(
      request,
      {.name = "soft_mount",
       .nats = there ? nats : std::min(kLogPriorEffect, nats),
       .parameters = {{"frequency_hz", {r.frequency_hz}, {kResonanceFrequency * r.frequency_hz}},
                      {"q", {r.q}, {kResonanceQ * r.q}}},
       .held_out_gain_nats = there ? r.held_out_nats : 0.0,
       .gap_mg2 = gap_mg2});
}

}  // namespace

std::vector<double> frequencies_of(const Lines& lines) {
  std::vector<double> frequencies_hz;
  for (const SpectralLine& line : lines.list) {
    frequencies_hz.push_back(line.frequency_hz);
  }
  return frequencies_hz;
}

Lines judge_lines(const Request& request, const CleanSamples& clean, const NoiseSpectrum& noise,
                  const CodeStatistics& codes) {
  // Noise that changes from dwell to dwell makes lines in the dwells where it is loud.
  constexpr double kUnsteady_sd = 10, kStrongLine_nats = 60, kMisfit_sd = 3;
  // A line was found at a threshold of its own: it counts as accepted by this much at least.
  constexpr double kLineCost_nats = 15, kFoundLine_nats = kAccept_nats + 0.5;
  constexpr double kLineFrequencySd_hz = 0.002;
  constexpr double kContradicts_nats = -5;
  constexpr double kCertainLine_nats = 25;  // noise reached 20 in 120 recordings
  constexpr double kApart_nats = 7;         // lines reached 4, what is none began at 10
  constexpr double kLineForm = 0.1;         // a line's size may change by this share
  Lines lines;
  const auto [list, bound_mg] = find_lines(request.bundle, clean, noise);
  lines.list = list;
  if (bound_mg) {
    lines.found.bounds["floor_vibration"] = lines.found.bounds["electrical_line"] = *bound_mg;
  }
  // The poses of one half contradict those of the other: a line that only some poses have, or noise
  // that differs from dwell to dwell (truncated, it is smaller where a mean lies near zero). What
  // one long record shows of a small line predicts nothing for a half that hardly shows it, so that
  // a line that is certain has to be another in each half.
  std::erase_if(lines.list, [&](const SpectralLine& line) {
    const bool certain = line.averaged_nats > kCertainLine_nats;
    const bool contradicts =
        line.held_out_nats < kContradicts_nats && !(certain && line.apart_nats < kApart_nats);
    if (contradicts && certain) {
      lines.found.alarm(
          nats_to_sd(line.averaged_nats),
          fmt::format("spectrum: a line at {:.2f} Hz in some poses only", line.frequency_hz));
    }
    return contradicts;
  });
  if (codes.spread_sd > kUnsteady_sd) {
    std::erase_if(lines.list, [](const SpectralLine& line) {
      return line.gain_nats < kStrongLine_nats && line.misfit_sd > kMisfit_sd;
    });
  }
  for (const SpectralLine& line : lines.list) {
    // Such a change adds this share, squared, of the line's chi-square to the misfit's; a standard
    // deviation of that is more than two.
    const double form = kLineForm * kLineForm * line.gain_nats;
    lines.found.test(
        line.misfit_sd - form,
        fmt::format("spectrum: the line at {:.2f} Hz comes and goes", line.frequency_hz),
        noise_places(request));
  }
  std::map<std::string, EffectFinding> by_name;  // by the strongest line of each
  for (const SpectralLine& line : lines.list) {
    const double power_mg2 = line.vector_mg.squaredNorm() / 2;
    lines.power_mg2 += power_mg2;
    std::string name = "floor_vibration";
    std::string other = "electrical_line";
    if (!line.in_lab) {
      name.swap(other);
    }
    const bool own = request.allowed(name);
    const bool has_name = own || (!line.decidable && request.allowed(other));
    lines.found.outside_means.push_back({own || !has_name ? name : other, power_mg2 / 3});
    if (!has_name) {
      lines.found.alarm(nats_to_sd(line.gain_nats),
                        fmt::format("spectrum: a line at {:.2f} Hz, {:.2f} mg", line.frequency_hz,
                                    line.vector_mg.norm()));
      continue;
    }
    const auto size_sd = [&](Eigen::Index a) {
      return std::hypot(line.sd_mg, kFormShare * line.vector_mg[a]);
    };
    EffectFinding f{
        .name = own ? name : other,
        .nats = std::max(line.gain_nats - kLineCost_nats + kLogPriorEffect, kFoundLine_nats),
        .held_out_gain_nats = line.held_out_nats};
    if (request.allowed(other) && own) {
      f.other_nats = -std::abs(line.lab_over_sensor_nats);
    }
    f.parameters = {{"vector_mg",
                     {line.vector_mg[0], line.vector_mg[1], line.vector_mg[2]},
                     {size_sd(0), size_sd(1), size_sd(2)}},
                    {"frequency_hz", {line.frequency_hz}, {kLineFrequencySd_hz}}};
    if (!line.decidable) {
      f.confounded_with.push_back(other);
    }
    f.gap_mg2 = power_mg2 / 3;
    const auto [strongest, is_first] = by_name.emplace(f.name, f);
    if (!is_first) {
      strongest->second.gap_mg2 += f.gap_mg2;
      strongest->second.further_lines.push_back(std::move(f.parameters));
    }
  }
  for (auto& [name, f] : by_name) {
    lines.found.add(request, std::move(f));
  }
  return lines;
}

ResponseStep judge_response(const Request& request, const NoiseSpectrum& noise,
                            const std::vector<ToneFit>& tones, const Lines& lines) {
  ResponseOptions options;
  options.lines_hz = frequencies_of(lines);
  options.allow_low_pass = request.allowed("bandwidth");
  options.allow_resonance = request.allowed("soft_mount");
  options.named_from_nats = kResponseCost_nats - kLogPriorEffect + kAccept_nats;
  const std::vector<ToneFit> whole = whole_tones(tones);
  ResponseStep step;
  step.response = find_response(request.bundle, noise, whole, options);
  judge_low_pass(request, step.response, whole, step.found);
  if (step.response.bound_corner_hz > 0) {
    step.found.bounds["bandwidth"] = step.response.bound_corner_hz;
  }
  if (step.response.bound_mount_hz > 0) {
    step.found.bounds["soft_mount"] = step.response.bound_mount_hz;
  }
  if (step.response.has_tones && options.allow_resonance) {
    judge_resonance(request, step.response, whole, step.found);
  }
  return step;
}

Settling judge_settling(const Request& request, const CleanSamples& clean,
                        const NoiseSpectrum& noise, const Lines& lines, const Response& response) {
  // Conventions: prior of the amplitude (and phase), number of independent pairs of frequency and
  // decay, gain of ringing over a plain decay, how strong ringing is surely no rest of a line, and
  // how near a line is.
  constexpr double kAmplitudePrior = 0.03, kPairs = 60, kRings_nats = 3;
  constexpr double kTypicalDecay_s = 0.4;  // the catalogue's, of the bound
  constexpr double kSurelyRings_sd = 4.5, kNearLine_hz = 2.5;
  // A mount rings in several modes: how far frequency and decay of one mode stand for all.
  constexpr double kModeShare = 0.03, kDecayShare = 0.15;
  // Mean square of a decaying sine over a dwell; share of the dwells that ring: a convention.
  constexpr double kDwell_s = 10, kRingingShare = 0.6;
  Settling settling;
  const std::vector<double> lines_hz = frequencies_of(lines);
  settling.step = step_response(request.bundle, clean, noise, lines_hz);
  const StepResponse& step = settling.step;
  if (!step.usable) {
    return settling;
  }
  const StepResponse::Mode& mode = step.mode;
  const double sd = std::max(1e-9, mode.amplitude_sd);
  const double relative = sd / std::max(1e-9, mode.amplitude);
  const auto cost_nats = [&](double amplitude_sd) {
    return 2 * std::log1p(kAmplitudePrior / amplitude_sd) + std::log(kPairs) - kLogPriorEffect;
  };
  EffectFinding f{.name = "settling", .nats = step.gain_nats - cost_nats(sd)};
  // A mode of amplitude a has a^2 / 2 per squared standard uncertainty, and its phase one more by
  // chance. That uncertainty: of either quadrature, whose samples weigh exp(-2 t / decay) / 2.
  const double bound_sd = step.sd * std::sqrt(4 / (kTypicalDecay_s * request.bundle.rate_hz));
  settling.found.bounds["settling"] =
      bound_sd * std::sqrt(2 * (kAccept_nats + cost_nats(bound_sd) - 1));
  const bool significant = f.nats > kAccept_nats;
  if (significant) {
    f.held_out_gain_nats = held_out_step_nats(request.bundle, clean, noise, lines_hz);
  }
  // A filter begins at rest: what it makes of the first samples looks like a second mode.
  const double amplitude = response.low_pass_significant ? mode.amplitude : step.amplitude;
  f.parameters = {
      {"amplitude", {amplitude}, {std::hypot(sd, kFormShare * amplitude)}},
      {"frequency_hz",
       {mode.frequency_hz},
       {std::hypot(relative / (2 * M_PI * std::max(0.03, mode.decay_s)),
                   kModeShare * mode.frequency_hz)}},
      {"decay_s", {mode.decay_s}, {std::hypot(2 * relative, kDecayShare) * mode.decay_s}}};
  // A line has a phase of its own in every dwell; the rest of it in their mean looks like ringing
  // at its frequency.
  const bool is_line =
      mode.amplitude < kSurelyRings_sd * step.sd &&
      std::any_of(lines.list.begin(), lines.list.end(), [&](const SpectralLine& line) {
        return std::abs(line.frequency_hz - mode.frequency_hz) < kNearLine_hz;
      });
  const bool there = significant && !is_line;
  const bool rings = step.gain_nats > step.plain_nats + kRings_nats;
  const bool named = there && rings && request.allowed("settling");
  settling.unexplained = there && !named;
  if (named) {
    f.gap_mg2 = std::pow(1000 * amplitude, 2) * mode.decay_s / 4 / kDwell_s * kRingingShare;
    settling.found.outside_means.push_back({f.name, f.gap_mg2});
  }
  if (named || !there) {
    settling.found.add(request, std::move(f));
  }
  return settling;
}

}  // namespace sixpoint::gap
