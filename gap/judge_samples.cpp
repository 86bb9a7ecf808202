#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"
#include "gap/features/texture.h"

namespace sixpoint::gap {

void Diagnoser::judge_discrete() {
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
  // A hold that ends at a segment's end is a short run of its own.
  if (clean_.stuck.samples > 0 &&
      (clean_.held.runs == 0 || clean_.stuck.runs > 1 + clean_.held.runs / 5)) {
    alarm(20, fmt::format("codes: {} short runs of one value", clean_.stuck.runs));
  }
  if (clean_.wrapped_samples > 3) {
    const double nats = 5.0 * static_cast<double>(clean_.wrapped_samples) + kLogPrior;
    extra_mg2_ += share(clean_.wrapped_samples, n) * 8.5e7;
    if (allowed("wrap")) {
      find({"wrap", 0, nats, {}, nats, false, {}});
    } else {
      alarm(100,
            fmt::format("codes: {} samples overflowed in the high shaker", clean_.wrapped_samples));
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

void Diagnoser::judge_texture() {
  // A line is no noise, and truncation swallows noise about zero.
  if (!lines_.lines.empty() || accepted("truncation")) {
    return;
  }
  // These have their distribution by theory, not to a percent only: thirty tests at 4.5 sd alarm by
  // chance once in ten thousand bundles.
  constexpr double kExact = kAlarm_sd - 4.5;
  for (const Texture::Scale& scale : noise_texture(bundle_, clean_).scales) {
    const std::string noise =
        scale.samples == 0 ? "the fast noise"
                           : fmt::format("the noise within {:.2g} s",
                                         2 * static_cast<double>(scale.samples) / bundle_.rate_hz);
    test(std::abs(scale.tails_sd) + kExact, fmt::format("codes: {} is not Gaussian", noise));
    test(scale.dwells_sd + kExact, fmt::format("codes: {} changes from dwell to dwell", noise));
    test(scale.moments_sd + kExact, fmt::format("codes: {} comes and goes", noise));
    test(scale.loudest_sd + kExact,
         fmt::format("codes: {} is loud for a moment (segment {})", noise,
                     bundle_.segments[scale.loudest_segment].name));
  }
}

void Diagnoser::judge_codes() {
  if (codes_.samples == 0) {
    return;
  }
  const bool line = !lines_.lines.empty();
  const bool format = accepted("truncation");
  const bool coloured = response_.low_pass_significant;
  for (std::size_t a = 0; a < 3; ++a) {
    const double off = std::abs(codes_.odd_share[a] - 0.5);
    if (off > (format ? 0.35 : 0.05) && off > 6 * codes_.parity_sd[a]) {
      alarm(30, fmt::format("codes: odd and even values of axis {} are not alike", "XYZ"[a]));
    }
  }
  if (codes_.outliers >= 3) {
    alarm(10 + std::sqrt(static_cast<double>(codes_.outliers)),
          fmt::format("codes: {} samples far outside the noise", codes_.outliers));
  }
  // What slow noise adds to the variance of seven seconds is itself random.
  const double white = *std::min_element(noise_.white_mg.begin(), noise_.white_mg.end());
  const double slow = slow_variance_mg2(7);
  const double wider = std::pow(slow / (white * white + slow), 2) * 3.5 * bundle_.rate_hz;
  if (!line && !format && !coloured) {
    const double spread =
        codes_.spread_freedom > 0
            ? (codes_.spread_sd - wider * std::sqrt(codes_.spread_freedom / 2)) / (1 + wider)
            : 0;
    test(spread - 0.5, fmt::format("codes: the noise changes from dwell to dwell (worst: {})",
                                   bundle_.segments[codes_.worst_segment].name));
    test(codes_.kurtosis_sd / (1 + wider) - 1, "codes: the noise is not Gaussian");
    test(std::abs(codes_.code_sd) / (1 + wider) - 0.5,
         fmt::format("codes: axis {} has the value {} {} often than its neighbours let expect",
                     "XYZ"[codes_.code_axis], codes_.code, codes_.code_sd < 0 ? "less" : "more"));
  }
  if (!line) {
    test(std::abs(codes_.cross_correlation_sd) / std::sqrt(1 + wider) - 0.5,
         "codes: the noise of two axes goes together");
  }
  if (!coloured && !accepted("duplicated_samples") && !line) {
    test(codes_.repeats_excess_sd - 0.5, "codes: values repeat more often than chance");
  }
}

}  // namespace sixpoint::gap
