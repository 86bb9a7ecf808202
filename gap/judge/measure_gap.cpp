#include <algorithm>
#include <cmath>
#include <set>

#include "gap/explain/catalogue.h"
#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

constexpr double kTwoSided95 = 1.96;  // standard deviations
// Evidence of marked samples, and scatter of the dwells' variances, in the units of a chi-square
// per number (conventions).
constexpr double kCodesScale = 100;
constexpr double kSpreadScale = 0.05;

double root(double square) { return std::sqrt(std::max(0.0, square)); }

double tone_nats(const Response& response) {
  return (response.low_pass_significant ? response.low_pass.tone_nats : 0) +
         (response.resonance_significant ? response.resonance.tone_nats : 0);
}

// sqrt(chi-square per number) of one feature, before and after.
using BeforeAfter = std::array<double, 2>;

BeforeAfter tone_feature(const Records& records, const Explanation::HeldOut& held) {
  double before2 = std::pow(held.tone_before_sigma, 2);
  if (records.response.has_tones) {
    before2 += 2 * tone_nats(records.response) /
               std::max<double>(1, static_cast<double>(records.tones.size()));
  }
  return {root(before2), root(std::pow(held.tone_after_sigma, 2))};
}

BeforeAfter spectrum_feature(const Records& records, const Findings& found) {
  const double bins =
      3.0 * static_cast<double>(std::max<std::size_t>(1, records.noise.frequency_hz.size()));
  double line_nats = 0;
  double left_nats = 0;  // of lines that have no name
  for (const SpectralLine& line : records.lines.list) {
    line_nats += line.gain_nats;
    left_nats += found.accepted(line.in_lab ? "floor_vibration" : "electrical_line") ||
                         (!line.decidable &&
                          found.accepted(line.in_lab ? "electrical_line" : "floor_vibration"))
                     ? 0
                     : line.gain_nats;
  }
  const auto noise = [&](double sd) { return 1 + std::max(0.0, sd) * std::sqrt(2 / bins); };
  return {root(noise(records.response.noise_flat_sd) + 2 * line_nats / bins),
          root(noise(records.response.noise_left_sd) + 2 * left_nats / bins)};
}

// Sum of 2 nats per number over the accepted effects of these families, times `scale`, from
// `start`.
double family_chi(const Findings& found, const std::set<std::string_view>& families,
                  std::size_t numbers, double scale, double start) {
  double chi = start;
  for (const EffectFinding& e : found.effects) {
    const CatalogueEntry* entry = find_entry(e.name);
    if (entry != nullptr && families.count(entry->family) != 0) {
      chi += 2 * e.nats / std::max<double>(1, static_cast<double>(numbers)) * scale;
    }
  }
  return chi;
}

BeforeAfter code_feature(const CodeStatistics& codes, const Findings& found) {
  const double spread = std::max(0.0, codes.spread_sd) * kSpreadScale;
  const double marks =
      family_chi(found, {"holds", "range", "number_format", "axes"}, codes.samples, kCodesScale, 1);
  return {root(marks + spread), root(1 + spread)};
}

BeforeAfter timing_feature(const HostTiming& host, const Findings& found) {
  if (!host.usable) {
    return {0, 0};
  }
  const double stamp_ms = 1e3 * kHostStamp_s / std::sqrt(3.0);
  const double scatter2 = std::pow(host.scatter_ms / stamp_ms, 2);
  return {root(family_chi(found, {"timing"}, host.packets, 1, 1) - 1 + scatter2), root(scatter2)};
}

}  // namespace

GapSize measure_gap(const Records& records, const Explanation& explanation, const Findings& found) {
  std::set<std::string> named;
  for (const EffectFinding& e : found.effects) {
    named.insert(e.name);
  }
  const Explanation::HeldOut held = explanation.held_out(named);
  double outside_mg2 = 0;
  double left_mg2 = 0;  // of what nothing named explains
  for (const OutsideMeans& outside : found.outside_means) {
    outside_mg2 += outside.mg2;
    left_mg2 += named.count(outside.effect) != 0 ? 0 : outside.mg2;
  }
  // With what the means do not show, in mg and in standard deviations.
  const auto with = [](double mg, double more_mg2) { return std::sqrt(mg * mg + more_mg2); };
  const auto sigma_with = [&](double sigma, double more_mg2) {
    return held.floor_mg > 0 ? with(sigma, more_mg2 / std::pow(held.floor_mg, 2)) : 0;
  };
  GapSize gap;
  gap.floor_mg = held.floor_mg;
  gap.before_mg = with(held.before_mg, outside_mg2);
  gap.before_sigma = sigma_with(held.before_sigma, outside_mg2);
  // What is not explained stays: without any effect nothing is closed.
  const bool open = found.effects.empty();
  gap.after_mg = open ? gap.before_mg : with(held.after_mg, left_mg2);
  gap.after_sigma = open ? gap.before_sigma : sigma_with(held.after_sigma, left_mg2);
  // Three rows are one independent mean; relative uncertainty of a root mean square: 1 / sqrt(2 n).
  const double half = kTwoSided95 * gap.after_mg / std::sqrt(2.0 * std::max(1, held.rows / 3));
  gap.after_interval_mg = {std::max(0.0, gap.after_mg - half), gap.after_mg + half};
  const double floor2 = gap.floor_mg * gap.floor_mg;
  const double above = gap.before_mg * gap.before_mg - floor2;
  const double left = std::max(0.0, gap.after_mg * gap.after_mg - floor2);
  gap.closed_fraction =
      found.effects.empty() || above <= 0 ? 0 : std::clamp(1 - left / above, 0.0, 1.0);
  gap.by_feature = {{{held.mean_before_sigma, held.mean_after_sigma},
                     tone_feature(records, held),
                     spectrum_feature(records, found),
                     code_feature(records.codes, found),
                     timing_feature(records.host, found)}};
  return gap;
}

}  // namespace sixpoint::gap
