#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "gap/features/texture.h"
#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// Evidence of each marked sample (conventions, well below what chance allows: nats of one repeat at
// the noise's size are 4 and more).
constexpr double kPerRepeat_nats = 3;
constexpr double kPerWrap_nats = 5;
constexpr double kPerClip_nats = 3;
constexpr double kPerTurn_nats = 1000;  // for each g of misfit
constexpr std::size_t kFewWraps = 3;
// Alarms for marks whose effect is not in the catalogue: they are certain.
constexpr double kCertain_sd = 100;
constexpr double kTurnedAlarm_sd = 200;
constexpr double kShortRunsAlarm_sd = 20;
// Mean square that a share of samples adds to the gap: 1 g on one of three axes for zeros and
// holds, 1 g for clipped samples, 16 g on one of three axes for wraps.
constexpr double kHold_mg2 = 333'333;
constexpr double kClip_mg2 = 1e6;
constexpr double kWrap_mg2 = 8.5e7;

constexpr double kLevelSd_g = 0.02;  // convention: uncertainty of a saturation's level

void judge_turned_axes(const Request& request, const CleanSamples& clean, Findings& found) {
  NamedValue matrix{"matrix", {}, {}};
  for (Eigen::Index r = 0; r < 3; ++r) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      matrix.value.push_back(clean.axis_matrix(r, c));
    }
  }
  const double nats = kPerTurn_nats * clean.axes_gain_g;
  const double gap_mg2 = std::pow(1000 * clean.axes_gain_g, 2);
  found.outside_means.push_back({"axis_rotation", gap_mg2});
  if (request.allowed("axis_rotation")) {
    found.add(request, {.name = "axis_rotation",
                        .nats = nats,
                        .parameters = {std::move(matrix)},
                        .held_out_gain_nats = nats,
                        .gap_mg2 = gap_mg2});
  } else {
    found.alarm(kTurnedAlarm_sd, "pose: axes are permuted or reversed against the protocol");
  }
}

double plateau_level_g(const CleanSamples& clean, double lsb_per_g) {
  double level = 0;
  double count = 0;
  for (const auto& [low, high] : clean.plateau_lsb) {
    if (low < 0 || high > 0) {
      level += (low < 0 && high > 0 ? (high - low) / 2 : std::max(-low, high)) / lsb_per_g;
      count += 1;
    }
  }
  return level / std::max(1.0, count);
}

}  // namespace

double share_of(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

Findings judge_marks(const Request& request, const CleanSamples& clean) {
  const Bundle& bundle = request.bundle;
  const std::size_t all = bundle.samples.size();
  Findings found;
  if (clean.axes_turned) {
    judge_turned_axes(request, clean, found);
  }
  // One effect that marks `samples`. `cost_nats`: of its fitted number.
  const auto mark = [&](EffectFinding effect, std::size_t samples, double per_sample_nats,
                        double cost_nats, double per_share_mg2, const std::string& words) {
    effect.nats = per_sample_nats * static_cast<double>(samples) + kLogPriorEffect;
    effect.held_out_gain_nats = effect.nats - cost_nats;
    effect.gap_mg2 = share_of(samples, all) * per_share_mg2;
    found.outside_means.push_back({effect.name, effect.gap_mg2});
    if (request.allowed(effect.name)) {
      found.add(request, std::move(effect));
    } else {
      found.alarm(kCertain_sd, "codes: " + words);
    }
  };
  const auto hold = [&](const char* name, const RunTally& tally, const char* parameter,
                        double value, const char* words) {
    if (tally.samples > 0) {
      mark({.name = name, .parameters = {{parameter, {value}, {1 / bundle.rate_hz}}}},
           tally.samples, kPerRepeat_nats, 1, kHold_mg2,
           fmt::format("{} ({} samples)", words, tally.samples));
    }
  };
  hold("charging_zeros", clean.zeros, "seconds",
       static_cast<double>(clean.zeros.samples) / bundle.rate_hz, "zero on all axes");
  hold("idle_sleep", clean.held, "fraction", share_of(clean.held.samples, all),
       "one value repeated for a second and more");
  // The shortest hold of each, and a level that is just not reached. Of turned axes and wraps there
  // is no size.
  found.bounds["charging_zeros"] = static_cast<double>(kZeroRun) / bundle.rate_hz;
  found.bounds["idle_sleep"] = bundle.rate_hz / static_cast<double>(std::max<std::size_t>(1, all));
  if (clean.driven_g > 0) {
    found.bounds["saturation"] = clean.driven_g;
  }
  if (clean.wrapped_samples > kFewWraps) {
    mark({.name = "wrap"}, clean.wrapped_samples, kPerWrap_nats, 0, kWrap_mg2,
         fmt::format("{} samples overflowed in the high shaker", clean.wrapped_samples));
  }
  if (clean.saturated) {
    const double level_g = plateau_level_g(clean, bundle.accel_scale_lsb_per_g);
    mark({.name = "saturation", .parameters = {{"level_g", {level_g}, {kLevelSd_g}}}},
         clean.plateau_samples, kPerClip_nats, 1, kClip_mg2,
         "values pile up below full scale in the high shaker");
  }
  return found;
}

namespace {

// Excess kurtosis that repeated samples add at one sample's scale, less at all others: a share of
// the differences is zero, which alone would add three times the share.
double excess_of_repeats(const Findings& before) {
  const auto found = std::ranges::find(before.effects, "duplicated_samples", &EffectFinding::name);
  return found == before.effects.end() ? 0 : 3 * found->parameters.front().value.front();
}

// A hold that ends at a segment's end is a short run of its own: one in five holds does. What a
// filter leaves of the noise stays on one value for long by chance.
void judge_short_runs(const Records& records, Findings& found) {
  const CleanSamples& clean = records.clean;
  if (!records.response.low_pass_significant && clean.stuck.samples > 0 &&
      (clean.held.runs == 0 || clean.stuck.runs > 1 + clean.held.runs / 5)) {
    found.alarm(kShortRunsAlarm_sd,
                fmt::format("codes: {} short runs of one value", clean.stuck.runs));
  }
}

}  // namespace

Findings judge_texture(const Request& request, const Records& records, const Findings& before) {
  Findings found;
  // Truncation changes noise about zero. What a strong line leaves where its frequency wanders is
  // neither noise nor another cause.
  constexpr double kStrongLines = 0.1;  // share of the noise's variance
  const double white_mg =
      *std::min_element(records.noise.white_mg.begin(), records.noise.white_mg.end());
  if (before.accepted("truncation") ||
      records.lines.power_mg2 > kStrongLines * white_mg * white_mg) {
    return found;
  }
  // The distribution of these is known by theory: forty tests that alarm at 4.5 sd do so by chance
  // once in ten thousand bundles.
  constexpr double kExactAlarm_sd = 4.5;
  // Beside a line, of which something may be left, they count as any other test.
  const double exact = records.lines.list.empty() ? kAlarm_sd - kExactAlarm_sd : 0;
  const std::vector<UnknownPlace> everywhere = noise_places(request);
  // What settling, which is named, follows moves with is taken off; its form is known to a share.
  const StepResponse& step = records.settling.step;
  const bool settles = before.accepted("settling");
  // The jump of a filter that began at rest: four of its time constants.
  const Response& response = records.response;
  constexpr double kFilter = 4 / (2 * M_PI);
  const double quiet_s = response.low_pass_significant
                             ? kFilter / response.low_pass.corner_hz * response.low_pass.order
                             : 0;
  const Texture texture = noise_texture(
      request.bundle, records.clean, frequencies_of(records.lines),
      settles ? [&](double t_s) { return step.model(t_s); } : std::function<double(double)>(),
      quiet_s);
  for (const Texture::Scale& scale : texture.scales) {
    const std::string noise =
        scale.samples == 0
            ? "the fast noise"
            : fmt::format("the noise within {:.2g} s",
                          2 * static_cast<double>(scale.samples) / request.bundle.rate_hz);
    const double excess_sd =
        scale.tails_sd -
        std::clamp(scale.tails_sd, 0.0, excess_of_repeats(before) * scale.sd_per_excess);
    found.test(std::abs(excess_sd) + exact, fmt::format("codes: {} is not Gaussian", noise),
               everywhere);
    found.test(scale.dwells_sd + exact, fmt::format("codes: {} changes from dwell to dwell", noise),
               everywhere);
    found.test(scale.moments_sd + exact, fmt::format("codes: {} comes and goes", noise),
               everywhere);
    found.test(scale.after_moves_sd - (settles ? kKnownRinging * step.left_without_sd : 0),
               fmt::format("transient: {} is louder after moves", noise), everywhere);
    found.test(scale.loudest_sd + exact,
               fmt::format("codes: {} is loud for a moment (segment {})", noise,
                           request.bundle.segments[scale.loudest_segment].name));
  }
  return found;
}

namespace {

// Conventions for the numbers themselves.
constexpr double kParityShare = 0.05;           // odd values may differ from one half by this
constexpr double kParityShareTruncated = 0.35;  // truncation empties the codes beside zero
constexpr double kParity_sd = 6;
constexpr double kParityAlarm_sd = 30;
constexpr std::size_t kFewOutliers = 3;
constexpr double kOutlierAlarm_sd = 10;
constexpr double kCodesChance_sd = 0.5;  // what small effects of the catalogue add to a test
constexpr double kKurtosisChance_sd = 1;

// Equal tests of single codes: parity and outliers.
void judge_single_codes(const Request& request, const CodeStatistics& codes, bool truncated,
                        Findings& found) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double off = std::abs(codes.odd_share[a] - 0.5);
    if (off > (truncated ? kParityShareTruncated : kParityShare) &&
        off > kParity_sd * codes.parity_sd[a]) {
      found.alarm(kParityAlarm_sd,
                  fmt::format("codes: odd and even values of axis {} are not alike", "XYZ"[a]),
                  noise_places(request, static_cast<int>(a)));
    }
  }
  if (codes.outliers >= kFewOutliers) {
    found.alarm(kOutlierAlarm_sd + std::sqrt(static_cast<double>(codes.outliers)),
                fmt::format("codes: {} samples far outside the noise", codes.outliers));
  }
}

// How many sd more often a sample equals the one before than the one seven before, because slow
// noise moved it further from that one. `slow_mg2`: its variance within seven seconds. Values whose
// difference has the variance 2 v are equal with probability lsb / (2 sqrt(pi v)).
double repeats_of_slow_noise_sd(const Request& request, const Records& records, double slow_mg2,
                                bool flicker) {
  constexpr double kFar = 7;  // samples, as CodeStatistics has it
  constexpr double kSeconds = 7;
  const double rate_hz = request.bundle.rate_hz;
  // Half the mean square of the further change: F^2 ln 7 of a density of F^2 / f, whose variance is
  // F^2 ln(seconds rate / 2); 6 / (2 rate) of a walk, whose variance is seconds / 6 (Allan 1966).
  const double further_mg2 = flicker ? slow_mg2 * std::log(kFar) / std::log(kSeconds * rate_hz / 2)
                                     : slow_mg2 * (kFar - 1) / (2 * rate_hz) * 6 / kSeconds;
  double pairs = static_cast<double>(records.codes.samples);  // that are equal
  double ratio = 1;                                           // of equal pairs, near over far
  for (const double white_mg : records.noise.white_mg) {
    const double near_mg2 = std::max(white_mg * white_mg, std::pow(request.lsb_mg(), 2) / 12);
    pairs *= request.lsb_mg() / (2 * std::sqrt(M_PI * (near_mg2 + further_mg2)));
    ratio *= std::sqrt(1 + further_mg2 / near_mg2);
  }
  return pairs * (ratio - 1) / std::sqrt(pairs * (ratio + 1) + 1);
}

}  // namespace

Findings judge_codes(const Request& request, const Records& records, double slow_mg2,
                     const Findings& before) {
  // Half the samples of a dwell of seven seconds, as CodeStatistics cuts them.
  constexpr double kHalfDwell_s = 3.5;
  Findings found;
  judge_short_runs(records, found);
  const CodeStatistics& codes = records.codes;
  if (codes.samples == 0) {
    return found;
  }
  const std::vector<UnknownPlace> everywhere = noise_places(request);
  const bool line = !records.lines.list.empty();
  const bool truncated = before.accepted("truncation");
  const bool coloured = records.response.low_pass_significant;
  judge_single_codes(request, codes, truncated, found);
  // What slow noise adds to the variance of a dwell is random: relative variance of that variance.
  const double white =
      *std::min_element(records.noise.white_mg.begin(), records.noise.white_mg.end());
  const double wider =
      std::pow(slow_mg2 / (white * white + slow_mg2), 2) * kHalfDwell_s * request.bundle.rate_hz;
  if (!line && !truncated && !coloured) {
    const double spread =
        codes.spread_freedom > 0
            ? (codes.spread_sd - wider * std::sqrt(codes.spread_freedom / 2)) / (1 + wider)
            : 0;
    found.test(spread - kCodesChance_sd,
               fmt::format("codes: the noise changes from dwell to dwell (worst: {})",
                           request.bundle.segments[codes.worst_segment].name),
               everywhere);
    found.test(codes.kurtosis_sd / (1 + wider) - kKurtosisChance_sd,
               "codes: the noise is not Gaussian", everywhere);
    found.test(
        std::abs(codes.code_sd) / (1 + wider) - kCodesChance_sd,
        fmt::format("codes: axis {} has the value {} {} often than its neighbours let expect",
                    "XYZ"[codes.code_axis], codes.code, codes.code_sd < 0 ? "less" : "more"),
        noise_places(request, static_cast<int>(codes.code_axis)));
  }
  if (!line) {
    found.test(std::abs(codes.cross_correlation_sd) / std::sqrt(1 + wider) - kCodesChance_sd,
               "codes: the noise of two axes goes together", everywhere);
  }
  if (!coloured && !before.accepted("duplicated_samples") && !line) {
    const double expected_sd =
        repeats_of_slow_noise_sd(request, records, slow_mg2, before.accepted("flicker"));
    found.test(codes.repeats_excess_sd - expected_sd - kCodesChance_sd,
               "codes: values repeat more often than chance", everywhere);
  }
  return found;
}

}  // namespace sixpoint::gap
