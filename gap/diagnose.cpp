#include "gap/diagnose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/blocks.h"
#include "gap/catalogue.h"
#include "gap/clean.h"
#include "gap/evidence.h"
#include "gap/features/lines.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/settling.h"
#include "gap/features/slow_noise.h"
#include "gap/features/timing.h"
#include "gap/features/tones.h"

namespace sixpoint::gap {
namespace {

constexpr double kLogPrior = -3.5;  // of one effect of the catalogue being there
// A test of what is left alarms at this many standard deviations: about forty tests, one false
// alarm in a thousand bundles if all were normal; their tails are heavier (chi-square, few dwells).
constexpr double kAlarm_sd = 5.5;
// The nominal simulator: white noise within 10 %, one estimate's error added.
constexpr std::array<double, 3> kNominalNoise_mg = {3.9, 3.9, 5.5};
constexpr double kNoiseReach = 0.135;
constexpr double kGainSd = 0.02;
constexpr double kOffsetSd_mg = 35;

double logistic(double nats) { return 1 / (1 + std::exp(-std::clamp(nats, -40.0, 9.0))); }

// The cube root of chi-square over its freedom is nearly normal (Wilson and Hilferty).
double chi_to_sd(double chi, double freedom) {
  if (freedom < 1) {
    return 0;
  }
  const double s = 2 / (9 * freedom);
  return (std::cbrt(chi / freedom) - (1 - s)) / std::sqrt(s);
}

// Where the forward model's groups keep the contract's parameter names.
std::string parameter_name(const std::string& effect) {
  static const std::map<std::string, std::string> kNames = {{"tilt", "rotation_vector_deg"},
                                                            {"misalignment", "rotation_vector_deg"},
                                                            {"non_orthogonality", "yz_xz_xy"},
                                                            {"second_order", "mg_per_g2"},
                                                            {"third_order", "mg_per_g3"},
                                                            {"hysteresis", "mg"},
                                                            {"offset_tempco", "mg_per_c"},
                                                            {"sensitivity_tempco", "percent_per_c"},
                                                            {"warm_up", "mg"},
                                                            {"drift", "mg_per_h"},
                                                            {"local_gravity", "ratio"},
                                                            {"seating", "sd_deg"},
                                                            {"random_walk", "mg_per_sqrt_s"},
                                                            {"flicker", "mg"}};
  const auto found = kNames.find(effect);
  return found == kNames.end() ? "" : found->second;
}

class Diagnoser {
 public:
  Diagnoser(const Bundle& bundle, const DiagnoseOptions& options)
      : bundle_(bundle), options_(options) {}

  Diagnosis run() {
    out_.bundle = bundle_.path;
    out_.serial = bundle_.protocol_serial.empty() ? bundle_.header.serial : bundle_.protocol_serial;
    out_.firmware = bundle_.header.firmware;
    out_.losses = bundle_.losses;
    out_.seed = options_.seed;
    find_abilities();
    clean_ = clean_samples(bundle_);
    judge_discrete();
    noise_ = noise_spectrum(bundle_, clean_);
    if (!noise_.usable()) {
      return give_up("too little of the recording lies still and unmasked to know even its noise");
    }
    judge_timing();
    judge_lines();
    judge_response();
    judge_settling();
    slow_ = slow_noise(bundle_, clean_, noise_);
    blocks_ = make_blocks(bundle_, clean_, noise_, tones_, response_);
    std::set<int> poses;
    for (const Block& block : blocks_) {
      const Eigen::Vector3d up = block.rotation.col(2);
      poses.insert(static_cast<int>(std::lround(2 * up[0]) * 25 + std::lround(2 * up[1]) * 5 +
                                    std::lround(2 * up[2])));
    }
    if (blocks_.empty() || clean_.pose_error_g > 0.45) {
      if (!blocks_.empty()) {
        alarm(50, "pose: the recording's axes do not follow the protocol's poses");
      }
      if (blocks_.empty()) {
        return give_up("no dwell of two unmasked seconds is left");
      }
    }
    if (poses.size() < 4) {
      out_.losses.push_back(fmt::format(
          "{} poses only: gains and offsets of the unit can't be told from effects", poses.size()));
      few_poses_ = true;
    }
    judge_means();
    judge_left_over();
    list_not_observable();
    measure_gap();
    finish();
    return std::move(out_);
  }

 private:
  bool allowed(const std::string& name) const { return options_.without.count(name) == 0; }

  // ---------------------------------------------------------------- what the protocol offers
  void find_abilities() {
    abilities_ = 0;
    std::set<std::string> faces;
    std::map<std::string, std::set<int>> yaws;
    std::map<std::string, int> placements;
    double coldest = 1e9, hottest = -1e9;
    double first_s = 1e18, last_s = -1e18;
    std::map<std::string, std::array<double, 2>> face_temperature;
    std::map<std::string, std::set<int>> approaches;
    int moves = 0;
    for (const Segment& s : bundle_.segments) {
      const Eigen::Vector3d up = s.rotation.col(2);
      const std::string face = fmt::format("{} {} {}", std::lround(3 * up[0]),
                                           std::lround(3 * up[1]), std::lround(3 * up[2]));
      const double t = s.host_start_s;
      first_s = std::min(first_s, t);
      last_s = std::max(last_s, t + static_cast<double>(s.samples) / bundle_.rate_hz);
      if (s.vibration) {
        abilities_ |= kShaker;
        if (s.vibration->amplitude_g >= 4) {
          abilities_ |= kHighShaker;
        }
        if (s.vibration->amplitude_g >= 8.5) {
          abilities_ |= kFullScale;
        }
        continue;
      }
      if (s.starts_placement) {
        ++placements[face];
        moves += s.approach_g.cwiseAbs().maxCoeff() > 0.2 ? 1 : 0;
        for (Eigen::Index a = 0; a < 3; ++a) {
          if (std::abs(s.approach_g[a]) > 0.05) {
            approaches[face + static_cast<char>('x' + a)].insert(s.approach_g[a] > 0 ? 1 : -1);
          }
        }
      }
      if (up.cwiseAbs().maxCoeff() > 0.99) {
        faces.insert(face);
      }
      yaws[face].insert(
          static_cast<int>(std::lround(std::atan2(s.rotation(0, 0) + 2 * s.rotation(1, 0),
                                                  s.rotation(0, 1) + 2 * s.rotation(1, 1)) *
                                       4)));
      const double a = bundle_.temperature_at(t);
      const double b = bundle_.temperature_at(t + static_cast<double>(s.samples) / bundle_.rate_hz);
      coldest = std::min({coldest, a, b});
      hottest = std::max({hottest, a, b});
      auto [at, fresh] = face_temperature.emplace(face, std::array<double, 2>{a, b});
      at->second = {std::min({at->second[0], a, b}), std::max({at->second[1], a, b})};
      if (static_cast<double>(s.samples) >= 300 * bundle_.rate_hz) {
        abilities_ |= kLongRecord;
      }
    }
    if (faces.size() >= 6) {
      abilities_ |= kPoses;
    }
    if (moves >= 2) {
      abilities_ |= kMoves;
    }
    for (const auto& [face, count] : placements) {
      abilities_ |= count >= 2 ? kRepeats : 0U;
    }
    int turned = 0;
    for (const auto& [face, set] : yaws) {
      turned += set.size() >= 3 ? 1 : 0;
    }
    abilities_ |= turned >= 3 ? kYaws : 0U;
    int both = 0;
    for (const auto& [key, signs] : approaches) {
      both += signs.size() >= 2 ? 1 : 0;
    }
    abilities_ |= both >= 3 ? kBothWays : 0U;
    abilities_ |= hottest - coldest > 5 ? kTemperature : 0U;
    int soaked = 0;
    for (const auto& [face, range] : face_temperature) {
      soaked += range[1] - range[0] > 5 ? 1 : 0;
    }
    abilities_ |= soaked >= 4 ? kSoak : 0U;
    abilities_ |= last_s - first_s > 1800 ? kHours : 0U;
    abilities_ |= bundle_.host_clock.empty() ? 0U : kHostClock;
    out_.protocol = (abilities_ & (kShaker | kTemperature)) == (kShaker | kTemperature)
                        ? "engineering"
                    : (abilities_ & kPoses) != 0 && last_s - first_s < 1200 ? "production"
                                                                            : "other";
  }

  // ---------------------------------------------------------------- findings and alarms
  void find(EffectFinding finding) {
    finding.probability = logistic(finding.nats);
    if (!allowed(finding.name)) {
      return;
    }
    const bool accepted = finding.nats > 0;
    if (accepted) {
      out_.effects.push_back(finding);
    }
    out_.candidates.push_back(std::move(finding));
  }
  bool accepted(const std::string& name) const {
    return std::any_of(out_.effects.begin(), out_.effects.end(),
                       [&](const EffectFinding& e) { return e.name == name; });
  }
  // Something is left over, this many standard deviations beyond chance.
  void alarm(double sd, std::string where) { alarms_.emplace_back(sd, std::move(where)); }
  void test(double sd, const std::string& where) {
    worst_sd_ = std::max(worst_sd_, sd);
    if (sd > kAlarm_sd) {
      alarm(sd, where);
    }
  }

  Diagnosis give_up(const std::string& why) {
    out_.inconclusive = true;
    out_.losses.push_back(why);
    out_.verdict = out_.effects.empty() ? Verdict::unexplained : Verdict::partly_explained;
    out_.unknown.present = true;
    out_.unknown.probability = 0.5;
    out_.unknown.where.push_back(why);
    for (const CatalogueEntry& entry : catalogue()) {
      if (!accepted(std::string(entry.name)) && allowed(std::string(entry.name))) {
        out_.not_observable.emplace_back(entry.name, entry.segment);
      }
    }
    complete_candidates();
    return std::move(out_);
  }

  static double share(std::size_t part, std::size_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  }

  // ---------------------------------------------------------------- discrete effects
  void judge_discrete() {
    const std::size_t n = bundle_.samples.size();
    if (clean_.axes_turned) {
      EffectFinding f{"axis_rotation", 0, 1000 * clean_.axes_gain_g, {}, 1000 * clean_.axes_gain_g,
                      false,           {}};
      NamedValue matrix{"matrix", {}, {}};
      for (Eigen::Index r = 0; r < 3; ++r) {
        for (Eigen::Index c = 0; c < 3; ++c) {
          matrix.value.push_back(clean_.axis_matrix(r, c));
        }
      }
      f.parameters.push_back(std::move(matrix));
      extra_mg2_ += std::pow(1000 * clean_.axes_gain_g, 2);
      if (allowed(f.name)) {
        find(std::move(f));
      } else {
        alarm(200, "pose: axes are permuted or reversed against the protocol");
      }
    }
    const auto hold = [&](const char* name, const RunTally& tally, const char* parameter,
                          double value, const char* words) {
      if (tally.samples == 0) {
        return;
      }
      const double nats = 3.0 * static_cast<double>(tally.samples) +
                          kLogPrior;                    // each sample repeated by chance: e^-4
      extra_mg2_ += share(tally.samples, n) * 333'333;  // 1 g on one of three axes
      if (allowed(name)) {
        find({name, 0, nats, {{parameter, {value}, {1 / bundle_.rate_hz}}}, nats - 1, false, {}});
      } else {
        alarm(100, fmt::format("codes: {} ({} samples)", words, tally.samples));
      }
    };
    hold("charging_zeros", clean_.zeros, "seconds",
         static_cast<double>(clean_.zeros.samples) / bundle_.rate_hz, "zero on all axes");
    hold("idle_sleep", clean_.held, "fraction", share(clean_.held.samples, n),
         "one value repeated for a second and more");
    if (clean_.stuck.samples > 0) {
      alarm(20, fmt::format("codes: {} short runs of one value", clean_.stuck.runs));
    }
    if (clean_.wrapped_samples > 3) {
      const double nats = 5.0 * static_cast<double>(clean_.wrapped_samples) + kLogPrior;
      extra_mg2_ += share(clean_.wrapped_samples, n) * 8.5e7;
      if (allowed("wrap")) {
        find({"wrap", 0, nats, {}, nats, false, {}});
      } else {
        alarm(100, fmt::format("codes: {} samples overflowed in the high shaker",
                               clean_.wrapped_samples));
      }
    }
    if (clean_.saturated) {
      double level = 0;
      double count = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        if (clean_.plateau_lsb[a][0] < 0 && clean_.plateau_lsb[a][1] > 0) {
          level += (clean_.plateau_lsb[a][1] - clean_.plateau_lsb[a][0]) / 2 /
                   bundle_.accel_scale_lsb_per_g;
          count += 1;
        } else if (clean_.plateau_lsb[a][0] < 0 || clean_.plateau_lsb[a][1] > 0) {
          level += std::max(-clean_.plateau_lsb[a][0], clean_.plateau_lsb[a][1]) /
                   bundle_.accel_scale_lsb_per_g;
          count += 1;
        }
      }
      level /= std::max(1.0, count);
      const double nats = 3.0 * static_cast<double>(clean_.plateau_samples) + kLogPrior;
      extra_mg2_ += share(clean_.plateau_samples, n) * 1e6;
      if (allowed("saturation")) {
        find({"saturation", 0, nats, {{"level_g", {level}, {0.02}}}, nats - 1, false, {}});
      } else {
        alarm(100, "codes: values pile up below full scale in the high shaker");
      }
    }
  }

  // ---------------------------------------------------------------- timing
  void judge_timing() {
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
        sum += -tone.frequency_ppm / (sd * sd);
      }
    }
    const double tone_ppm = weight > 0 ? sum / weight : 0;
    const double tone_sd = weight > 0 ? 1 / std::sqrt(weight) : 1e9;
    double tone_chi = 0;
    double tone_n = 0;
    for (const ToneFit& tone : tones_) {
      if (tone.usable && tone.slips.empty() && tone.frequency_sd_ppm > 0) {
        const double sd = std::hypot(tone.frequency_sd_ppm, 0.5);
        tone_chi += std::pow((-tone.frequency_ppm - tone_ppm) / sd, 2);
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
      clock_nats_ = nats;
      double mismatch = 0;
      for (const ToneFit& tone : tones_) {
        const Segment& s = bundle_.segments[tone.segment];
        const double turn = 2 * M_PI * s.vibration->frequency_hz * ppm * 1e-6 *
                            static_cast<double>(s.samples) / bundle_.rate_hz / std::sqrt(12.0);
        mismatch += std::pow(707 * s.vibration->amplitude_g * std::min(1.4, std::abs(turn)), 2);
      }
      if (nats > 0) {
        extra_mg2_ +=
            mismatch / std::max<double>(1, static_cast<double>(bundle_.segments.size())) / 3;
      }
      const bool can_be = std::abs(ppm) < 20'000;
      if (!allowed("clock_error") && nats > 0) {
        alarm(std::abs(z), fmt::format("timing: the sample clock is off by {:.0f} ppm", ppm));
      } else if (can_be) {
        find({"clock_error",
              0,
              nats,
              {{"ppm", {ppm}, {std::hypot(sd, 1.5)}}},
              nats - kLogPrior - 1,
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
      const double nats = count == 0 ? -2.0 : 12.0 * static_cast<double>(count) + kLogPrior;
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

  void judge_jitter() {
    double up = 0, down = 0, chi = 0, n = 0;
    double crest_up = 0;
    for (const ToneFit& tone : tones_) {
      if (!tone.usable || !tone.slips.empty() || tone.samples < 200) {
        continue;
      }
      const Segment& s = bundle_.segments[tone.segment];
      const double rate =
          2 * M_PI * s.vibration->frequency_hz * tone.in_phase_mg[tone.axis];  // mg/s
      const double white =
          noise_.variance_at(static_cast<std::size_t>(tone.axis), s.vibration->frequency_hz);
      // slope - crest = (rate * jitter)^2 / 2; either scatters by variance * sqrt(3/n) about.
      const double level = std::max(white, tone.residual_mg * tone.residual_mg);
      const double sd = level * std::sqrt(4.0 / static_cast<double>(tone.samples));
      const double lever = 0.5 * rate * rate;
      up += lever * (tone.on_slope_mg2 - tone.on_crest_mg2) / (sd * sd);
      down += lever * lever / (sd * sd);
      crest_up += 0.5 * lever * std::max(0.0, tone.on_crest_mg2 - white) / (sd * sd);
      const double excess = (tone.residual_mg * tone.residual_mg - white) /
                            (white * std::sqrt(2.0 / static_cast<double>(tone.samples)) * 1.6);
      chi += std::max(0.0, excess);
      n += 1;
    }
    if (n == 0) {
      return;
    }
    const double variance = up / down;
    const double z = up / std::sqrt(down);
    (void)crest_up;
    const double jitter_ms = 1e3 * std::sqrt(std::max(0.0, variance));
    const double sd_ms = jitter_ms > 0 ? 1e3 / std::sqrt(down) / (2 * jitter_ms / 1e3) : 0.05;
    const double nats = (z > 0 ? 0.5 * z * z : 0) - 4 + kLogPrior;
    if (nats > 0) {
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

  // ---------------------------------------------------------------- records: lines, response,
  // steps
  void judge_lines() {
    lines_ = find_lines(bundle_, clean_, noise_);
    std::map<std::string, EffectFinding> by_name;
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
      EffectFinding f{chosen, 0, line.gain_nats - 15 + kLogPrior, {}, line.gain_nats - 6,
                      false,  {}};
      f.parameters.push_back({"vector_mg",
                              {line.vector_mg[0], line.vector_mg[1], line.vector_mg[2]},
                              {line.sd_mg, line.sd_mg, line.sd_mg}});
      f.parameters.push_back({"frequency_hz", {line.frequency_hz}, {0.002}});
      if (!line.decidable) {
        f.confounded_with.push_back(other);
      }
      f.nats = std::max(f.nats, 1.0);
      if (by_name.count(chosen) == 0) {
        by_name.emplace(chosen, std::move(f));
      }
    }
    for (auto& [name, f] : by_name) {
      find(std::move(f));
    }
  }

  void judge_response() {
    ResponseOptions options;
    for (const SpectralLine& line : lines_.lines) {
      options.lines_hz.push_back(line.frequency_hz);
    }
    options.allow_low_pass = allowed("bandwidth");
    options.allow_resonance = allowed("soft_mount");
    std::vector<ToneFit> whole;
    for (const ToneFit& tone : tones_) {
      if (tone.slips.empty()) {
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
            low_nats - 2,
            false,
            {}});
      for (const ToneFit& tone : whole) {
        const Segment& s = bundle_.segments[tone.segment];
        const double h =
            low_pass_gain(s.vibration->frequency_hz, l.corner_hz, l.order, bundle_.rate_hz);
        extra_mg2_ += std::pow(707 * s.vibration->amplitude_g * (1 - h), 2) / 3 /
                      static_cast<double>(bundle_.segments.size());
      }
    } else if (allowed("bandwidth")) {
      find({"bandwidth",
            0,
            std::min(-0.5, low_nats - 14 + kLogPrior),
            {{"corner_hz", {response_.low_pass.corner_hz}, {}}},
            low_nats - 14,
            false,
            {}});
    }
    if (response_.has_tones && allowed("soft_mount")) {
      const Resonance& r = response_.resonance;
      const double nats = r.tone_nats - 10 + kLogPrior;
      find({"soft_mount",
            0,
            response_.resonance_significant ? nats : std::min(-0.5, nats),
            {{"frequency_hz", {r.frequency_hz}, {0.01 * r.frequency_hz}},
             {"q", {r.q}, {0.03 * r.q}}},
            r.tone_nats - 3,
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
    test(response_.noise_left_sd, "spectrum: the noise is not flat");
    test(response_.tone_left_sd, "tone: the amplitude depends on frequency");
    for (std::size_t a = 0; a < 3; ++a) {
      out_.unit.noise_mg[a] = response_.white_mg[a];
    }
  }

  void judge_settling() {
    step_ = step_response(bundle_, clean_, noise_);
    if (!step_.usable) {
      return;
    }
    // Frequency and decay were found among some sixty independent choices.
    const double nats = step_.gain_nats - 2 - std::log(60.0) + kLogPrior;
    const bool rings = step_.gain_nats > step_.plain_nats + 3;
    if (nats > 0 && rings && allowed("settling")) {
      find({"settling",
            0,
            nats,
            {{"amplitude", {step_.amplitude}, {step_.amplitude_sd}},
             {"frequency_hz",
              {step_.frequency_hz},
              {step_.amplitude_sd / step_.amplitude / (2 * M_PI * step_.decay_s)}},
             {"decay_s",
              {step_.decay_s},
              {step_.decay_s * step_.amplitude_sd / step_.amplitude * 2}}},
            step_.gain_nats - 4,
            false,
            {}});
      extra_mg2_ += std::pow(1000 * step_.amplitude, 2) * step_.decay_s / 4 / 10 * 0.6;
      test(step_.left_sd, "transient: the seconds after a move");
    } else {
      if (nats <= 0 && allowed("settling")) {
        find({"settling",
              0,
              nats,
              {{"amplitude", {step_.amplitude}, {step_.amplitude_sd}}},
              step_.gain_nats - 4,
              false,
              {}});
      }
      test(std::max(step_.left_without_sd, nats > 0 ? std::sqrt(2 * step_.gain_nats) : 0.0),
           "transient: the seconds after a move");
    }
  }

  // ---------------------------------------------------------------- means and tones together
  void judge_means() {
    EvidenceOptions options;
    options.lsb_mg = 1000 / bundle_.accel_scale_lsb_per_g;
    options.allowed = [this](const std::string& name) { return allowed(name); };
    options.record_nats = [this](Scatter scatter, double size) {
      const auto along = [&](const std::vector<double>& sizes, const auto& nats) {
        for (std::size_t i = 1; i < sizes.size(); ++i) {
          if (size <= sizes[i]) {
            const double share = (size - sizes[i - 1]) / (sizes[i] - sizes[i - 1]);
            return nats(i - 1) * (1 - share) + nats(i) * share;
          }
        }
        return nats(sizes.size() - 1);
      };
      if (scatter == Scatter::random_walk) {
        return along(slow_.walk_mg, [&](std::size_t i) { return slow_.nats[i][0]; });
      }
      if (scatter == Scatter::flicker) {
        return along(slow_.flicker_mg, [&](std::size_t i) { return slow_.nats[0][i]; });
      }
      return 0.0;
    };
    search_.emplace(blocks_, options);
    search_->run();
    const Fit& fit = search_->best_known();

    // What stays is judged against the best explanation; every linear effect becomes a candidate.
    std::set<std::string> names;
    for (const ParameterGroup& group : parameter_groups()) {
      if (group.effect != "gain" && group.effect != "offset" && allowed(group.effect)) {
        names.insert(group.effect);
      }
    }
    for (const std::string& name : names) {
      const auto estimate = search_->estimate(name);
      if (!estimate) {
        continue;
      }
      EffectFinding f;
      f.name = name;
      const bool in = std::any_of(fit.groups.begin(), fit.groups.end(),
                                  [&](const ParameterGroup& g) { return g.effect == name; });
      f.nats =
          in ? std::max(0.1, search_->gain_nats(name)) : std::min(-0.1, search_->gain_nats(name));
      f.held_out_gain_nats = search_->held_out_nats(name);
      if (name != "truncation") {
        f.parameters.push_back({parameter_name(name), estimate->value, estimate->sd});
      }
      if (name == "tilt") {
        const double angle = std::hypot(estimate->value[0], estimate->value[1]);
        f.parameters[0].value.push_back(0);
        f.parameters[0].sd.push_back(0);
        f.parameters.push_back(
            {"angle_deg", {angle}, {std::max(estimate->sd[0], estimate->sd[1])}});
      }
      if (name == "warm_up") {
        f.parameters.push_back({"tau_s", {estimate->tau_s}, {0.2 * estimate->tau_s}});
      }
      if (in) {
        f.confounded_with = confounded(name);
      }
      if (in && f.held_out_gain_nats <= 0) {
        f.nats = -0.1;  // it does not help where it was not fitted
      }
      find(std::move(f));
    }
    const auto scatter = [&](Scatter kind) {
      const std::string name(to_string(kind));
      if (!allowed(name)) {
        return;
      }
      const bool in = fit.scatter == kind;
      EffectFinding f;
      f.name = name;
      const double gain = search_->gain_nats(name);
      f.nats = in ? std::max(0.1, gain) : (gain == 0 ? -5 : std::min(-0.1, gain));
      f.held_out_gain_nats = in ? gain : std::min(0.0, gain);
      const double size = in ? fit.scatter_size : 0;
      f.parameters.push_back({parameter_name(name), {size}, {0.25 * size}});
      find(std::move(f));
    };
    scatter(Scatter::seating);
    scatter(Scatter::random_walk);
    scatter(Scatter::flicker);
    if (allowed("rounding_floor")) {
      find({"rounding_floor", 0, -0.7, {}, 0, false, {"offset"}});
    }
    judge_nuisances();
  }

  // Other effects that would do nearly as well in its place.
  std::vector<std::string> confounded(const std::string& name) const {
    std::vector<std::string> others;
    const double own = search_->gain_nats(name);
    const CatalogueEntry* entry = find_entry(name);
    for (const CatalogueEntry& other : catalogue()) {
      const std::string other_name(other.name);
      if (other_name == name || accepted(other_name)) {
        continue;
      }
      const double gain = search_->gain_nats(other_name);
      // gain of the other measured against the best without it, which holds this one.
      if (allowed(other_name) && gain > -3 && gain != 0 && own < 12 && entry != nullptr) {
        others.push_back(other_name);
      }
    }
    if (name == "local_gravity") {
      others.emplace_back("gain");
    }
    return others;
  }

  void judge_nuisances() {
    const ForwardState& s = search_->best_known().state;
    double chi = 0;
    double nominal = 0;
    for (Eigen::Index a = 0; a < 3; ++a) {
      out_.unit.gain[static_cast<std::size_t>(a)] = s.gain[a];
      out_.unit.offset_g[static_cast<std::size_t>(a)] = s.offset_mg[a] / 1000;
      const double g = (s.gain[a] - 1) / kGainSd;
      const double o = s.offset_mg[a] / kOffsetSd_mg;
      chi += g * g + o * o;
      nominal += -0.5 * (g * g + o * o) - std::log(kGainSd) - std::log(kOffsetSd_mg);
    }
    if (few_poses_) {
      return;
    }
    // The wrong mode: a common gain anywhere in 0.78..0.97, the unit's own 2 % about it, and
    // offsets of 0.1 to 0.2 g.
    double wrong = -1e300;
    double best = -1e300;
    double common = 1;
    constexpr int kSteps = 96;
    constexpr double kWide_mg = 140;
    for (int k = 0; k < kSteps; ++k) {
      const double c = 0.78 + 0.19 * (k + 0.5) / kSteps;
      double nats = 0;
      for (Eigen::Index a = 0; a < 3; ++a) {
        nats += -0.5 * std::pow((s.gain[a] / c - 1) / kGainSd, 2) - std::log(kGainSd * c) -
                0.5 * std::pow(s.offset_mg[a] / kWide_mg, 2) - std::log(kWide_mg);
      }
      if (nats > best) {
        best = nats;
        common = c;
      }
      wrong = wrong == -1e300
                  ? nats
                  : std::max(wrong, nats) + std::log1p(std::exp(-std::abs(wrong - nats)));
    }
    wrong -= std::log(static_cast<double>(kSteps));
    const double nats = wrong - nominal + kLogPrior;
    const double z = chi_to_sd(chi, 6);
    // The unit's own gain and offset can't be known beside the mode's.
    EffectFinding f{"filter_mismatch", 0, nats, {}, nats - kLogPrior, false, {}};
    f.parameters.push_back({"gain", {common}, {kGainSd / std::sqrt(3.0)}});
    f.parameters.push_back({"offset_g",
                            {s.offset_mg[0] / 1000, s.offset_mg[1] / 1000, s.offset_mg[2] / 1000},
                            {0.03, 0.03, 0.03}});
    if (allowed("filter_mismatch")) {
      if (nats > 0) {
        double square = 0;
        for (Eigen::Index a = 0; a < 3; ++a) {
          out_.unit.gain[static_cast<std::size_t>(a)] /= common;
          out_.unit.offset_g[static_cast<std::size_t>(a)] = 0;
          square += std::pow(1000 * (1 - common), 2) / 3 + std::pow(s.offset_mg[a], 2);
        }
        extra_mg2_ += square / 3;
        mismatch_ = true;
      }
      find(std::move(f));
    }
    if (!mismatch_ && chi > 45) {  // chi-square of six: 5e-8
      alarm(z, "nuisance: gains or offsets of the unit lie far outside their priors");
    }
    nuisance_sd_ = z;
  }

  // ---------------------------------------------------------------- what is left
  void judge_left_over() {
    const Fit& fit = search_->best_known();
    const double n = static_cast<double>(fit.residual.size());
    const double p = static_cast<double>(fit.posterior.columns.size());
    test(chi_to_sd(fit.residual.squaredNorm(), n - p), "mean: dwells and tones together");
    std::map<std::string, std::array<double, 2>> groups;
    std::vector<double> block_chi(blocks_.size(), 0);
    for (Eigen::Index row = 0; row < fit.residual.size(); ++row) {
      const int b = fit.row_block[static_cast<std::size_t>(row)];
      const Block& block = blocks_[static_cast<std::size_t>(b)];
      auto& group = groups[bundle_.segments[block.segment].name];
      group[0] += fit.residual[row] * fit.residual[row];
      group[1] += 1;
    }
    for (const auto& [name, group] : groups) {
      test(chi_to_sd(group[0], group[1]), fmt::format("mean: segment {}", name));
    }
    if (const auto& other = search_->best_unknown()) {
      const double gain = other->nats - fit.nats;
      if (gain > 3) {
        alarm(std::sqrt(2 * gain) + 3,
              fmt::format("mean: scatter by {}", to_string(other->scatter)));
      }
      unknown_gain_ = gain;
    }
    // Slow noise that the catalogue was not asked for, or does not hold.
    const bool slow_accepted =
        fit.scatter == Scatter::random_walk || fit.scatter == Scatter::flicker;
    const SlowNoise::Best best = slow_.best_both();
    if (!slow_accepted && best.nats > 12) {
      alarm(std::sqrt(2 * best.nats), "spectrum: slow noise inside the dwells");
    }
    test(slow_.misfit_sd, "spectrum: wander inside the dwells");
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
      const double total = noise_total(axis) + rate * rate / 2;
      const double z = (tone.residual_mg * tone.residual_mg / total - 1) /
                       std::sqrt(2 / samples + (jitter_s_ > 0 ? 0.01 : 0));
      test(z - 1, fmt::format("tone: residual at {} Hz, {} g", s.vibration->frequency_hz,
                              s.vibration->amplitude_g));
      if (tone.clipped_share > 0 && jitter_s_ == 0) {
        double h = 1;
        if (response_.low_pass_significant) {
          h *= low_pass_gain(s.vibration->frequency_hz, response_.low_pass.corner_hz,
                             response_.low_pass.order, bundle_.rate_hz);
        }
        if (response_.resonance_significant) {
          h *= resonance_gain(s.vibration->frequency_hz, response_.resonance);
        }
        const double expected = 1000 * h * s.vibration->amplitude_g *
                                std::abs((s.rotation * s.vibration->direction_lab)[tone.axis]) *
                                search_->best_known().state.gain[tone.axis];
        const double off = std::abs(tone.in_phase_mg[tone.axis] / expected - 1);
        test(
            off > 0.03 ? 20 * off / 0.03 : 0,
            fmt::format("tone: amplitude of the clipped tone at {} Hz", s.vibration->frequency_hz));
      }
    }
    if (freedom > 0) {
      test(chi_to_sd(chi, freedom), "tone: motion in quadrature across the axes");
    }
    for (std::size_t a = 0; a < 3; ++a) {
      const double ratio = response_.white_mg[a] / kNominalNoise_mg[a];
      if (std::abs(ratio - 1) > kNoiseReach) {
        alarm(
            6 + 20 * (std::abs(ratio - 1) - kNoiseReach),
            fmt::format("spectrum: noise of axis {} is {:.2f} times the nominal", "XYZ"[a], ratio));
      }
    }
    judge_codes();
  }

  double noise_total(std::size_t axis) const {
    double sum = 0;
    for (const double v : noise_.variance_mg2[axis]) {
      sum += v;
    }
    return sum / static_cast<double>(std::max<std::size_t>(1, noise_.variance_mg2[axis].size()));
  }

  void judge_codes() {
    const bool line = !lines_.lines.empty();
    const bool format = accepted("truncation");
    const bool coloured = response_.low_pass_significant;
    for (std::size_t a = 0; a < 3; ++a) {
      const double off = std::abs(codes_.odd_share[a] - 0.5);
      if (off > 0.05 && off > 6 * codes_.parity_sd[a]) {
        alarm(30, fmt::format("codes: odd and even values of axis {} are not alike", "XYZ"[a]));
      }
    }
    if (codes_.outliers >= 3) {
      alarm(10 + std::sqrt(static_cast<double>(codes_.outliers)),
            fmt::format("codes: {} samples far outside the noise", codes_.outliers));
    }
    if (!line && !format) {
      test(codes_.spread_sd - 0.5,
           fmt::format("codes: the noise changes from dwell to dwell (worst: {})",
                       bundle_.segments[codes_.worst_segment].name));
      test(codes_.kurtosis_sd - 1, "codes: the noise is not Gaussian");
    }
    if (!line) {
      test(std::abs(codes_.cross_correlation_sd) - 0.5,
           "codes: the noise of two axes goes together");
    }
    if (!coloured && !accepted("duplicated_samples") && !line) {
      test(codes_.repeats_excess_sd - 0.5, "codes: values repeat more often than chance");
    }
  }

  // ---------------------------------------------------------------- what can't be seen
  void list_not_observable() {
    for (const CatalogueEntry& entry : catalogue()) {
      const std::string name(entry.name);
      if (accepted(name) || !allowed(name)) {
        continue;
      }
      bool missing = (entry.needs & ~abilities_) != 0;
      if (name == "clock_error" || name == "dropped_samples" || name == "duplicated_samples") {
        missing = !timing_.usable && (abilities_ & kShaker) == 0;
        if (name == "clock_error" && !missing) {
          const double sd = timing_.usable ? timing_.clock_sd_ppm : 1;
          missing =
              sd > 10 && (abilities_ & kShaker) == 0;  // hundreds of ppm would still have shown
        }
      } else if (!missing && !parameter_name(name).empty() && search_ && name != "seating" &&
                 name != "random_walk" && name != "flicker") {
        missing = search_->undetermined(name) > 0.35;
      }
      if (name == "axis_rotation") {
        missing = !clean_.axes_decidable;
      }
      if (missing) {
        out_.not_observable.emplace_back(
            name, entry.segment.empty() ? "none" : std::string(entry.segment));
      }
    }
    struct Offer {
      const char* name;
      double minutes;
      unsigned gives;
    };
    constexpr std::array<Offer, 9> kOffers = {{{"faces", 1.7, kPoses | kMoves},
                                               {"faces_reversed", 1.7, kBothWays | kRepeats},
                                               {"reseat", 2.7, kRepeats},
                                               {"yaw", 6.5, kYaws},
                                               {"shaker", 9, kShaker},
                                               {"shaker_high", 6, kHighShaker | kFullScale},
                                               {"still", 20, kLongRecord | kHours},
                                               {"ramp_up", 18, kTemperature | kHours},
                                               {"soak", 46, kSoak | kTemperature | kHours}}};
    constexpr double kEntropy = 0.135;  // nats of "is it there", at one in thirty
    for (const Offer& offer : kOffers) {
      NextSegment next{offer.name, offer.minutes, 0, {}};
      if ((offer.gives & ~abilities_) != 0) {
        for (const auto& [name, segment] : out_.not_observable) {
          if (segment == offer.name) {
            next.separates.push_back(name);
            next.expected_nats += kEntropy;
          }
        }
      }
      for (const EffectFinding& e : out_.effects) {
        for (const std::string& other : e.confounded_with) {
          const CatalogueEntry* entry = find_entry(other);
          if (entry != nullptr && entry->segment == offer.name &&
              (offer.gives & ~abilities_) != 0) {
            next.separates.push_back(e.name + "/" + other);
            next.expected_nats += 0.69;
          }
        }
      }
      if (!next.separates.empty()) {
        out_.next_segments.push_back(std::move(next));
      }
    }
    std::sort(out_.next_segments.begin(), out_.next_segments.end(),
              [](const NextSegment& a, const NextSegment& b) {
                return a.expected_nats / a.minutes > b.expected_nats / b.minutes;
              });
  }

  // ---------------------------------------------------------------- sizes
  void measure_gap() {
    const EvidenceSearch::HeldOut held = search_->held_out();
    GapSize& gap = out_.gap;
    gap.floor_mg = held.floor_mg;
    gap.before_mg = std::sqrt(held.before_mg * held.before_mg + extra_mg2_);
    gap.after_mg = held.after_mg;
    gap.before_sigma =
        held.floor_mg > 0
            ? std::sqrt(std::pow(held.before_sigma, 2) + extra_mg2_ / std::pow(held.floor_mg, 2))
            : 0;
    gap.after_sigma = held.after_sigma;
    if (!alarms_.empty()) {
      // What is not explained stays: effects outside means count by what they would have taken off.
      double explained = 0;
      for (const EffectFinding& e : out_.effects) {
        explained += e.nats;
      }
      if (explained == 0) {
        gap.after_mg = gap.before_mg;
        gap.after_sigma = gap.before_sigma;
      }
    }
    const double half = 1.96 * gap.after_mg / std::sqrt(2.0 * std::max(1, held.rows / 3));
    gap.after_interval_mg = {std::max(0.0, gap.after_mg - half), gap.after_mg + half};
    const double open = gap.before_mg * gap.before_mg - gap.floor_mg * gap.floor_mg;
    const double left = std::max(0.0, gap.after_mg * gap.after_mg - gap.floor_mg * gap.floor_mg);
    gap.closed_fraction =
        out_.effects.empty() || open <= 0 ? 0 : std::clamp(1 - left / open, 0.0, 1.0);
    const auto pair = [](double before2, double after2) {
      return std::array<double, 2>{std::sqrt(std::max(0.0, before2)),
                                   std::sqrt(std::max(0.0, after2))};
    };
    gap.by_feature[0] = {held.mean_before_sigma, held.mean_after_sigma};
    double tone_before = std::pow(held.tone_before_sigma, 2);
    double tone_after = std::pow(held.tone_after_sigma, 2);
    if (response_.has_tones) {
      const double tones = std::max<double>(1, static_cast<double>(tones_.size()));
      tone_before += 2 *
                     ((response_.low_pass_significant ? response_.low_pass.tone_nats : 0) +
                      (response_.resonance_significant ? response_.resonance.tone_nats : 0)) /
                     tones;
    }
    gap.by_feature[1] = pair(tone_before, tone_after);
    const double bins =
        3.0 * static_cast<double>(std::max<std::size_t>(1, noise_.frequency_hz.size()));
    double line_nats = 0;
    for (const SpectralLine& line : lines_.lines) {
      line_nats += line.gain_nats;
    }
    gap.by_feature[2] = pair(
        1 + std::max(0.0, response_.noise_flat_sd) * std::sqrt(2 / bins) + 2 * line_nats / bins,
        1 + std::max(0.0, response_.noise_left_sd) * std::sqrt(2 / bins) +
            (accepted("floor_vibration") || accepted("electrical_line") ? 0
                                                                        : 2 * line_nats / bins));
    double code_before = 1;
    double time_before = 1;
    for (const EffectFinding& e : out_.effects) {
      const CatalogueEntry* entry = find_entry(e.name);
      if (entry != nullptr && (entry->family == "holds" || entry->family == "range" ||
                               entry->family == "number_format" || entry->family == "axes")) {
        code_before += 2 * e.nats / std::max<double>(1, static_cast<double>(codes_.samples)) * 100;
      }
      if (entry != nullptr && entry->family == "timing") {
        time_before += 2 * e.nats / std::max<double>(1, static_cast<double>(timing_.packets));
      }
    }
    gap.by_feature[3] = pair(code_before + std::max(0.0, codes_.spread_sd) * 0.05,
                             1 + std::max(0.0, codes_.spread_sd) * 0.05);
    const double scatter2 =
        timing_.usable ? std::pow(timing_.scatter_ms / (1e3 * kHostStamp_s / std::sqrt(3.0)), 2)
                       : 0;
    gap.by_feature[4] = pair(timing_.usable ? time_before - 1 + scatter2 : 0, scatter2);

    // Where: the nominal simulator's residuals by axis and segment.
    struct Cell {
      double square_mg2 = 0, square = 0, n = 0;
      std::string factor;
    };
    std::map<std::pair<int, std::string>, Cell> cells;
    std::vector<Plots::Residual> plots;
    const Fit& nominal = search_->nominal();
    const Fit& best = search_->best_known();
    int last_block = -1;
    int k = 0;
    for (Eigen::Index row = 0; row < nominal.residual.size(); ++row) {
      const int b = nominal.row_block[static_cast<std::size_t>(row)];
      k = b == last_block ? k + 1 : 0;
      last_block = b;
      const Block& block = blocks_[static_cast<std::size_t>(b)];
      const Segment& segment = bundle_.segments[block.segment];
      const int axis = k < 3 ? k : k < 6 ? k - 3 : block.axis;
      const double scale =
          std::sqrt(block.white_mg2(k, k) +
                    std::pow(kNominalSeating_deg, 2) * seating_lever(block).row(k).squaredNorm());
      Cell& cell = cells[{axis, segment.name}];
      cell.square += std::pow(nominal.residual[row], 2);
      cell.square_mg2 += std::pow(nominal.residual[row] * scale, 2);
      cell.n += 1;
      cell.factor = block.tone ? (segment.vibration->amplitude_g > 1.5 ? "amplitude" : "frequency")
                    : segment.kind == Segment::Kind::still
                        ? (segment.name == "yaw"                                         ? "yaw"
                           : static_cast<double>(segment.samples) > 60 * bundle_.rate_hz ? "time"
                                                                                         : "pose")
                        : "temperature";
      if (k < 3) {
        const double s0 = nominal.residual[row];
        const double s1 = row < best.residual.size() ? best.residual[row] : 0;
        plots.push_back({axis, segment.name, static_cast<int>(block.segment), block.temperature_c,
                         block.middle_s / 60, s0 * scale, s0, s1 * scale, s1});
      }
    }
    for (const auto& [key, cell] : cells) {
      out_.where.push_back({key.first, key.second, cell.factor, std::sqrt(cell.square_mg2 / cell.n),
                            std::sqrt(cell.square / cell.n)});
    }
    for (const SpectralLine& line : lines_.lines) {
      for (int a = 0; a < 3; ++a) {
        out_.where.push_back({a, "still", fmt::format("frequency {:.2f} Hz", line.frequency_hz),
                              std::abs(line.vector_mg[a]) / M_SQRT2,
                              std::abs(line.vector_mg[a]) / std::max(1e-6, line.sd_mg)});
      }
    }
    if (accepted("settling") || step_.left_without_sd > kAlarm_sd) {
      out_.where.push_back({0, "faces", "time since move", 1000 * step_.amplitude / 2,
                            step_.amplitude / std::max(1e-9, step_.amplitude_sd)});
    }
    std::sort(out_.where.begin(), out_.where.end(),
              [](const Location& a, const Location& b) { return a.sigma > b.sigma; });
    if (out_.where.size() > 20) {
      out_.where.resize(20);
    }
    out_.plots.residuals = std::move(plots);
    out_.plots.frequency_hz = noise_.frequency_hz;
    out_.plots.noise_mg2 = noise_.variance_mg2;
    for (std::size_t a = 0; a < 3; ++a) {
      const double rounding = std::pow(1000 / bundle_.accel_scale_lsb_per_g, 2) / 12;
      for (const double f : noise_.frequency_hz) {
        const double h = response_.low_pass_significant
                             ? low_pass_gain(f, response_.low_pass.corner_hz,
                                             response_.low_pass.order, bundle_.rate_hz)
                             : 1;
        out_.plots.noise_model_mg2[a].push_back(std::pow(response_.white_mg[a] * h, 2) + rounding);
      }
    }
    for (std::size_t i = 0; i < step_.share.size(); i += 2) {
      const double t = static_cast<double>(i) / bundle_.rate_hz;
      out_.plots.step_s.push_back(t);
      out_.plots.step_share.push_back(step_.share[i]);
      out_.plots.step_model.push_back(
          accepted("settling") ? step_.amplitude * std::exp(-t / step_.decay_s) *
                                     std::cos(2 * M_PI * step_.frequency_hz * t + step_.phase_rad)
                               : 0);
    }
    for (const ToneFit& tone : tones_) {
      if (!tone.usable) {
        continue;
      }
      const Segment& s = bundle_.segments[tone.segment];
      double h = 1;
      if (response_.low_pass_significant) {
        h *= low_pass_gain(s.vibration->frequency_hz, response_.low_pass.corner_hz,
                           response_.low_pass.order, bundle_.rate_hz);
      }
      if (response_.resonance_significant) {
        h *= resonance_gain(s.vibration->frequency_hz, response_.resonance);
      }
      const double gain = best.state.gain[tone.axis] * 1000 * s.vibration->amplitude_g;
      out_.plots.tones.push_back({tone.axis, s.vibration->frequency_hz, s.vibration->amplitude_g,
                                  gain > 0 ? tone.in_phase_mg[tone.axis] / gain : 0, h});
    }
  }

  void complete_candidates() {
    for (const CatalogueEntry& entry : catalogue()) {
      const std::string name(entry.name);
      if (allowed(name) && std::none_of(out_.candidates.begin(), out_.candidates.end(),
                                        [&](const EffectFinding& c) { return c.name == name; })) {
        EffectFinding f;
        f.name = name;
        f.nats = kLogPrior;
        f.probability = logistic(kLogPrior);
        out_.candidates.push_back(std::move(f));
      }
    }
    const auto stronger = [](const EffectFinding& a, const EffectFinding& b) {
      return a.nats > b.nats;
    };
    std::stable_sort(out_.effects.begin(), out_.effects.end(), stronger);
    std::stable_sort(out_.candidates.begin(), out_.candidates.end(), stronger);
    for (auto* list : {&out_.effects, &out_.candidates}) {
      for (EffectFinding& f : *list) {
        const CatalogueEntry* entry = find_entry(f.name);
        if (entry != nullptr && entry->datasheet > 0 && !f.parameters.empty()) {
          for (const double v : f.parameters.front().value) {
            f.outside_datasheet = f.outside_datasheet || std::abs(v) > entry->datasheet;
          }
        }
      }
    }
  }

  void finish() {
    complete_candidates();
    std::sort(alarms_.begin(), alarms_.end(),
              [](const auto& a, const auto& b) { return a.first > b.first; });
    out_.unknown.present = !alarms_.empty();
    for (const auto& [sd, where] : alarms_) {
      if (out_.unknown.where.size() < 8) {
        out_.unknown.where.push_back(where);
      }
    }
    if (alarms_.empty()) {
      // The largest of some forty tests reaches 2.5 sd by chance.
      out_.unknown.probability =
          0.03 + 0.3 * std::clamp((worst_sd_ - 3) / (kAlarm_sd - 3), 0.0, 1.0);
    } else {
      out_.unknown.probability = std::min(0.999, 0.9 + 0.02 * (alarms_.front().first - kAlarm_sd));
    }
    const bool any = !out_.effects.empty();
    out_.verdict = out_.unknown.present ? (any ? Verdict::partly_explained : Verdict::unexplained)
                                        : (any ? Verdict::explained : Verdict::no_gap);
  }

  const Bundle& bundle_;
  const DiagnoseOptions& options_;
  Diagnosis out_;
  unsigned abilities_ = 0;
  CleanSamples clean_;
  NoiseSpectrum noise_;
  HostTiming timing_;
  std::vector<ToneFit> tones_;
  LineSearch lines_;
  Response response_;
  StepResponse step_;
  SlowNoise slow_;
  CodeStatistics codes_;
  std::vector<Block> blocks_;
  std::optional<EvidenceSearch> search_;
  std::vector<std::pair<double, std::string>> alarms_;
  double worst_sd_ = 0;
  double extra_mg2_ = 0;
  double jitter_s_ = 0;
  double clock_nats_ = 0;
  double nuisance_sd_ = 0;
  double unknown_gain_ = 0;
  bool mismatch_ = false;
  bool few_poses_ = false;
};

}  // namespace

Result<Diagnosis> diagnose(const Bundle& bundle, const DiagnoseOptions& options) {
  for (const std::string& name : options.without) {
    if (find_entry(name) == nullptr) {
      return fail(ErrorCode::usage,
                  fmt::format("the catalogue has no effect '{}'", printable(name, 60)), "--without",
                  "sixpoint gap diagnose lists all names under `candidates`");
    }
  }
  return Diagnoser(bundle, options).run();
}

}  // namespace sixpoint::gap
