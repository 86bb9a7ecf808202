#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// The wrong acquisition mode (16CPAN03): offsets of 0.1 to 0.2 g (design of the catalogue).
constexpr double kWideOffset_mg = 140;
constexpr double kOffsetSd_g = 0.03;  // the unit's own offset can't be known beside the mode's
// Gains of single axes that went astray: prior standard deviation (convention).
constexpr double kWideGain = 0.15;
// Units of this scale exist, too. Protocols within 2 % of it are of that kind.
constexpr double kCoarse_lsb_per_g = 256;
constexpr double kSameScale = 0.98;
// Chi-square of six beyond which gains and offsets are no unit's: a probability of 5e-8.
constexpr double kFarOut_chi = 45;

// A common gain anywhere in 0.73 to 0.97, with the unit's own 2 % about it.
constexpr double kLeastCommonGain = 0.73, kCommonGainSpan = 0.24;

// Log density of gains and offsets of a unit, if the gains lie about `centre`; no constants.
double unit_nats(const ForwardState& s, double centre) {
  double nats = 0;
  for (Eigen::Index a = 0; a < 3; ++a) {
    const double g = (s.gain[a] / centre - 1) / kGainSd;
    const double o = s.offset_mg[a] / kOffsetSd_mg;
    nats += -0.5 * (g * g + o * o) - std::log(kGainSd * centre) - std::log(kOffsetSd_mg);
  }
  return nats;
}

// The same of one axis, for any spread.
double axis_nats(double gain, double centre, double gain_sd, double offset_mg,
                 double offset_sd_mg) {
  return -0.5 * std::pow((gain / centre - 1) / gain_sd, 2) - std::log(gain_sd * centre) -
         0.5 * std::pow(offset_mg / offset_sd_mg, 2) - std::log(offset_sd_mg);
}

struct WrongMode {
  double nats = 0;    // mean over all common gains
  double common = 1;  // the likeliest
};

WrongMode wrong_mode(const ForwardState& s) {
  constexpr int kCommonGains = 120;
  WrongMode mode;
  double best = kNoEvidence_nats;
  for (int k = 0; k < kCommonGains; ++k) {
    const double c = kLeastCommonGain + kCommonGainSpan * (k + 0.5) / kCommonGains;
    double nats = 0;
    for (Eigen::Index a = 0; a < 3; ++a) {
      nats += axis_nats(s.gain[a], c, kGainSd, s.offset_mg[a], kWideOffset_mg);
    }
    if (nats > best) {
      best = nats;
      mode.common = c;
    }
    // Logarithm of a sum of exponentials.
    mode.nats = k == 0
                    ? nats
                    : std::max(mode.nats, nats) + std::log1p(std::exp(-std::abs(mode.nats - nats)));
  }
  mode.nats -= std::log(static_cast<double>(kCommonGains));
  return mode;
}

// The likeliest way in which gains or offsets, of one axis or of all, are wide without a common
// factor; the number of ways taken off.
double astray_nats(const ForwardState& s) {
  double most = kNoEvidence_nats;
  int ways = 0;
  for (const unsigned axes : {1U, 2U, 4U, 7U}) {
    for (unsigned which = 1; which < 4; ++which, ++ways) {
      double sum = 0;
      for (Eigen::Index a = 0; a < 3; ++a) {
        const bool wide = (axes & (1U << static_cast<unsigned>(a))) != 0;
        const double gain_sd = wide && (which & 1U) != 0 ? kWideGain : kGainSd;
        const double offset_sd = wide && (which & 2U) != 0 ? kWideOffset_mg : kOffsetSd_mg;
        sum += axis_nats(s.gain[a], 1, gain_sd, s.offset_mg[a], offset_sd);
      }
      most = std::max(most, sum);
    }
  }
  return most - std::log(static_cast<double>(ways));
}

// Takes the mode's gain and offsets off the unit; their mean square is a gap outside the means.
void undo_mode(const ForwardState& s, double common, Nuisances& nuisances) {
  double square = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    nuisances.unit.gain[a] /= common;
    nuisances.unit.offset_g[a] = 0;
    square += std::pow(1000 * (1 - common), 2) / 3 +
              std::pow(s.offset_mg[static_cast<Eigen::Index>(a)], 2);
  }
  nuisances.found.outside_means.push_back({"filter_mismatch", square / 3});
}

// The common gain, of a unit without offsets, from which on down a mode is accepted.
double bound_gain() {
  double low = kLeastCommonGain, high = 1;
  for (int halving = 0; halving < 20; ++halving) {
    const double middle = (low + high) / 2;
    ForwardState s;
    s.gain.setConstant(middle);
    const double nats = wrong_mode(s).nats - unit_nats(s, 1) + kLogPriorEffect;
    (nats > kAccept_nats ? low : high) = middle;
  }
  return low;
}

}  // namespace

Nuisances judge_nuisances(const Request& request, const ForwardState& s, bool judged) {
  Nuisances out;
  double chi = 0;
  for (Eigen::Index a = 0; a < 3; ++a) {
    out.unit.gain[static_cast<std::size_t>(a)] = s.gain[a];
    out.unit.offset_g[static_cast<std::size_t>(a)] = s.offset_mg[a] / 1000;
    const double g = (s.gain[a] - 1) / kGainSd;
    const double o = s.offset_mg[a] / kOffsetSd_mg;
    chi += g * g + o * o;
  }
  if (!judged) {
    return out;
  }
  out.found.bounds["filter_mismatch"] = bound_gain();
  const WrongMode mode = wrong_mode(s);
  const double gain_nats = mode.nats - unit_nats(s, 1) + kLogPriorEffect;
  const double z = chi_to_sd(chi, 6);
  EffectFinding f{
      .name = "filter_mismatch",
      .nats = gain_nats,
      .parameters = {{"gain", {mode.common}, {kGainSd / std::sqrt(3.0)}},
                     {"offset_g",
                      {s.offset_mg[0] / 1000, s.offset_mg[1] / 1000, s.offset_mg[2] / 1000},
                      {kOffsetSd_g, kOffsetSd_g, kOffsetSd_g}}},
      .held_out_gain_nats = gain_nats - kLogPriorEffect,
      .other_nats = astray_nats(s) + kLogPriorUnknown - mode.nats - kLogPriorEffect};
  const bool significant = gain_nats > kAccept_nats;
  if (significant && f.other_nats > kUnknownWins_nats) {
    f.nats = -0.1;  // set: another cause is likelier
    out.found.alarm(nats_to_sd(f.other_nats) + kAlarm_sd,
                    "nuisance: gains or offsets are far out, but not as a wrong mode has them");
  }
  // A protocol that takes a unit of 256 LSB/g for one of 341 reads alike: then the gains lie about
  // that ratio as closely as they should about 1, and the offsets where they should.
  const double ratio = kCoarse_lsb_per_g / request.bundle.accel_scale_lsb_per_g;
  const double scale_nats = ratio < kSameScale ? unit_nats(s, ratio) - mode.nats : kNoEvidence_nats;
  f.other_nats = std::max(f.other_nats, scale_nats);
  if (significant && scale_nats > 0) {
    out.found.alarm(
        z, fmt::format("scale: the gains are those of a unit of {:g} LSB/g, the protocol says {:g}",
                       kCoarse_lsb_per_g, request.bundle.accel_scale_lsb_per_g));
    return out;
  }
  const bool mismatch = request.allowed(f.name) && f.nats > kAccept_nats;
  if (mismatch) {
    undo_mode(s, mode.common, out);
    f.gap_mg2 = out.found.outside_means.back().mg2;
  } else if (chi > kFarOut_chi) {
    out.found.alarm(z, "nuisance: gains or offsets of the unit lie far outside their priors");
  }
  out.found.add(request, std::move(f));
  return out;
}

}  // namespace sixpoint::gap
