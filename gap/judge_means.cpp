#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"
#include "gap/slow_structure.h"

namespace sixpoint::gap {

namespace {

constexpr double kOtherWins = 3;            // twenty to one, as for scatter of unknown kinds
constexpr double kLogPriorChanging = -4.5;  // as of each unknown kind

// Whether the zero's curve over temperature lies outside what goes with its slope: beyond four
// standard deviations, and surely so. Zeros bend by a per cent of their slope per degree.
bool bends(const Fit& fit) {
  constexpr double kShare = 0.01;
  constexpr double kLeast_mg_per_c2 = 0.001;
  const double slope = fit.state.tempco_mg_per_c.cwiseAbs().maxCoeff();
  Eigen::Index at = 6;
  for (const ParameterGroup& group : fit.groups) {
    for (int i = 0; i < group.count; ++i, ++at) {
      if (group.effect == "offset_tempco" && i >= 3 &&
          std::abs(fit.posterior.mean[at]) - 3 * std::sqrt(fit.posterior.covariance(at, at)) >
              4 * std::min(group.curve_sd, std::max(kLeast_mg_per_c2, kShare * slope))) {
        return true;
      }
    }
  }
  return false;
}

// nats(i) belongs to sizes[i]; in between a straight line.
template <typename Nats>
double interpolated(const std::vector<double>& sizes, const Nats& nats, double size) {
  for (std::size_t i = 1; i < sizes.size(); ++i) {
    if (size <= sizes[i]) {
      const double share = (size - sizes[i - 1]) / (sizes[i] - sizes[i - 1]);
      return nats(i - 1) * (1 - share) + nats(i) * share;
    }
  }
  return nats(sizes.size() - 1);
}

}  // namespace

// Slow noise has one size, within dwells as between them: log odds of one of its own for each,
// less what the free number costs.
double Diagnoser::size_apart_nats(Scatter kind) const {
  constexpr double kCost = 1.5;
  double best = 0;
  double here = 0;
  const double size = search_->best().scatter_size;
  const auto along = [&](const std::vector<double>& sizes, const auto& nats) {
    // The two are computed by approximations that differ, and what else there is adds to one of
    // them: sizes within a factor of two are the same.
    constexpr double kAlike = 2;
    here = std::max(interpolated(sizes, nats, size / kAlike),
                    interpolated(sizes, nats, size * kAlike));
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      if (sizes[i] > size / kAlike && sizes[i] < size * kAlike) {
        here = std::max(here, nats(i));
      }
    }
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      best = std::max(best, nats(i));
    }
  };
  if (kind == Scatter::random_walk) {
    along(slow_.walk_mg, [&](std::size_t i) { return slow_.nats[i][0]; });
  } else if (kind == Scatter::flicker) {
    along(slow_.flicker_mg, [&](std::size_t i) { return slow_.nats[0][i]; });
  }
  return best - here - kCost;
}

void Diagnoser::judge_means() {
  EvidenceOptions options;
  options.lsb_mg = 1000 / bundle_.accel_scale_lsb_per_g;
  options.allowed = [this](const std::string& name) { return allowed(name); };
  options.record_nats = [this](Scatter scatter, double size) {
    if (scatter == Scatter::random_walk) {
      return interpolated(
          slow_.walk_mg, [&](std::size_t i) { return slow_.nats[i][0]; }, size);
    }
    if (scatter == Scatter::by_time || scatter == Scatter::by_time_fast) {
      // Unknown in time: any spectrum that the records show.
      return std::max({0.0, slow_.best_both().nats - 4, slow_.free_nats});
    }
    if (scatter == Scatter::flicker) {
      return interpolated(
          slow_.flicker_mg, [&](std::size_t i) { return slow_.nats[0][i]; }, size);
    }
    return 0.0;
  };
  search_.emplace(blocks_, options);
  search_->run();
  const Fit& fit = search_->best();

  // What stays is judged against the best explanation; every linear effect becomes a candidate.
  std::set<std::string> names;
  for (const ParameterGroup& group : parameter_groups()) {
    if (group.effect != "gain" && group.effect != "offset" && allowed(group.effect)) {
      names.insert(group.effect);
    }
  }
  // Whatever changes takes from the probability of all that is named as constant.
  double changing = -1e3;
  for (const Inconstancy& inconstancy : search_->inconstancies()) {
    changing = std::max(changing, inconstancy.nats + kLogPriorChanging);
    if (inconstancy.nats + kLogPriorChanging > kOtherWins) {
      alarm(std::sqrt(2 * inconstancy.nats) + kAlarm_sd,
            fmt::format("mean: {} changes with {}", inconstancy.term, inconstancy.factor));
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
      // Real effects keep to a catalogue's straight lines within some percent.
      std::vector<double> sd = estimate->sd;
      if (name == "drift" || name == "warm_up" || name == "offset_tempco") {
        for (std::size_t i = 0; i < sd.size(); ++i) {
          sd[i] = std::hypot(sd[i], kFormShare * estimate->value[i]);
        }
      }
      f.parameters.push_back({parameter_name(name), estimate->value, std::move(sd)});
    }
    if (name == "tilt") {
      const double angle = std::hypot(estimate->value[0], estimate->value[1]);
      f.parameters[0].value.push_back(0);
      f.parameters[0].sd.push_back(0);
      f.parameters.push_back({"angle_deg", {angle}, {std::max(estimate->sd[0], estimate->sd[1])}});
    }
    if (name == "warm_up") {
      f.parameters.push_back({"tau_s", {estimate->tau_s}, {0.2 * estimate->tau_s}});
    }
    if (in) {
      f.confounded_with = confounded(name);
    }
    if (in && search_->unknown_wins() && f.nats < 50) {
      f.nats = -0.1;  // beside scatter of an unknown kind only what stands out counts
    }
    if (in && f.held_out_gain_nats <= 0) {
      f.nats = -0.1;  // it does not help where it was not fitted
    }
    if (in) {
      // What is certain beside a change stays so: its evidence pays for both.
      f.other_nats = std::min(changing, kOtherWins - 0.1 * std::max(0.0, f.nats - 20));
    }
    if (in && name != "drift" && name != "warm_up") {
      const double other = search_->changing_nats(name) + kLogPriorChanging;
      if (other > kOtherWins) {
        alarm(std::sqrt(2 * other) + kAlarm_sd,
              fmt::format("mean: {} that changes while the recording runs", name));
      }
      f.other_nats = std::max(f.other_nats, other);
    }
    if (in && name == "offset_tempco" && bends(fit)) {
      alarm(2 * kAlarm_sd, "mean: the zero bends over temperature more than a zero's drift does");
      f.other_nats = kOtherWins;
    }
    find(std::move(f));
  }
  if (const double nats = search_->changing_nats("gain") + kLogPriorChanging; nats > kOtherWins) {
    alarm(std::sqrt(2 * nats) + kAlarm_sd, "mean: gains that change while the recording runs");
  }
  const auto scatter = [&](Scatter kind) {
    const std::string name(to_string(kind));
    if (!allowed(name)) {
      return;
    }
    const bool in = fit.scatter == kind;
    EffectFinding f;
    f.name = name;
    const double gain = search_->gain_nats(name, in);
    f.nats = in ? std::max(0.1, gain) : (gain == 0 ? -5 : std::min(-0.1, gain));
    if (in) {
      f.other_nats = search_->unknown_nats();
      const SlowStructure structure = kind == Scatter::seating
                                          ? SlowStructure{}
                                          : slow_structure(blocks_, fit, slow_, options.lsb_mg);
      f.other_nats = std::max(f.other_nats, structure.other_nats);
      const double apart = size_apart_nats(kind) + kLogPriorChanging;
      if (apart > std::max(0.0, f.other_nats)) {
        alarm(std::sqrt(2 * apart) + kAlarm_sd,
              fmt::format("mean: {} between dwells, but not of that size within them", name));
      }
      if (apart > std::max(0.0, f.other_nats)) {
        f.other_nats = apart;
        f.nats = -0.1;
      } else if (f.other_nats > 0) {
        // Likelier than the noise that would be named; where the odds are even, neither is.
        const bool by_structure = structure.other_nats >= f.other_nats;
        f.nats = -0.1;
        alarm(std::sqrt(2 * f.other_nats) + kAlarm_sd,
              by_structure ? "mean: slow, but " + structure.other
                           : fmt::format("mean: scatter by {}, or {}",
                                         to_string(search_->best_unknown()->scatter), name));
      }
    }
    f.held_out_gain_nats = in ? gain : std::min(0.0, gain);
    const double size = in ? fit.scatter_size : 0;
    f.parameters.push_back({parameter_name(name), {size}, {0.12 * size}});
    find(std::move(f));
  };
  scatter(Scatter::seating);
  scatter(Scatter::random_walk);
  scatter(Scatter::flicker);
  if (allowed("rounding_floor")) {
    // Nothing can tell it from an offset of half an LSB: what is known is the prior.
    find({"rounding_floor", 0, kLogPrior, {}, 0, false, {"offset"}});
  }
  // What explains much, but so do others, is a gap all the same.
  const bool named = std::any_of(out_.effects.begin(), out_.effects.end(), [&](const auto& e) {
    return e.name == to_string(fit.scatter) ||
           std::any_of(fit.groups.begin(), fit.groups.end(),
                       [&](const ParameterGroup& g) { return g.effect == e.name; });
  });
  const double much = fit.nats - search_->nominal().nats;
  if (!named && alarms_.empty() && much > 6) {
    alarm(std::sqrt(2 * much) + 2, "mean: several explanations do alike");
  }
  judge_nuisances();
}

std::vector<std::string> Diagnoser::confounded(const std::string& name) const {
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

void Diagnoser::judge_nuisances() {
  const ForwardState& s = search_->best().state;
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
  // Gains that were fitted to poses which are none of the unit's mean nothing.
  if (few_poses_ || poses_wrong_ || options_.uncalibrated) {
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
    wrong = wrong == -1e300 ? nats
                            : std::max(wrong, nats) + std::log1p(std::exp(-std::abs(wrong - nats)));
  }
  wrong -= std::log(static_cast<double>(kSteps));
  // Gains and offsets that went astray otherwise: of one axis or of all, each by itself.
  constexpr double kWideGain = 0.15;
  std::vector<double> astray;
  for (unsigned axes = 1; axes < 8; ++axes) {
    if (axes != 7 && (axes & (axes - 1)) != 0) {
      continue;  // one, or all
    }
    for (unsigned which = 1; which < 4; ++which) {
      double sum = 0;
      for (Eigen::Index a = 0; a < 3; ++a) {
        const bool of_it = (axes & (1U << static_cast<unsigned>(a))) != 0;
        const double gain_sd = of_it && (which & 1U) != 0 ? kWideGain : kGainSd;
        const double offset_sd = of_it && (which & 2U) != 0 ? kWide_mg : kOffsetSd_mg;
        sum += -0.5 * std::pow((s.gain[a] - 1) / gain_sd, 2) - std::log(gain_sd) -
               0.5 * std::pow(s.offset_mg[a] / offset_sd, 2) - std::log(offset_sd);
      }
      astray.push_back(sum);
    }
  }
  const double most_astray = *std::max_element(astray.begin(), astray.end());
  const double nats = wrong - nominal + kLogPrior;
  const double z = chi_to_sd(chi, 6);
  // The unit's own gain and offset can't be known beside the mode's.
  EffectFinding f{"filter_mismatch", 0, nats, {}, nats - kLogPrior, false, {}};
  f.other_nats = most_astray - std::log(static_cast<double>(astray.size())) + kLogPriorChanging -
                 wrong - kLogPrior;
  if (nats > kAccept && f.other_nats > kOtherWins) {
    f.nats = -0.1;
    alarm(std::sqrt(2 * f.other_nats) + kAlarm_sd,
          "nuisance: gains or offsets are far out, but not as a wrong mode has them");
  }
  f.parameters.push_back({"gain", {common}, {kGainSd / std::sqrt(3.0)}});
  f.parameters.push_back({"offset_g",
                          {s.offset_mg[0] / 1000, s.offset_mg[1] / 1000, s.offset_mg[2] / 1000},
                          {0.03, 0.03, 0.03}});
  // A protocol that takes a unit of 256 LSB/g for one of 341 (both exist) reads alike: then the
  // gains stand about that ratio as closely as they should about 1, and the zeros where they
  // should.
  constexpr double kCoarse_lsb_per_g = 256;
  const double ratio = kCoarse_lsb_per_g / bundle_.accel_scale_lsb_per_g;
  if (ratio < 0.98) {
    double other = 0;
    for (Eigen::Index a = 0; a < 3; ++a) {
      other += -0.5 * (std::pow((s.gain[a] / ratio - 1) / kGainSd, 2) +
                       std::pow(s.offset_mg[a] / kOffsetSd_mg, 2)) -
               std::log(kGainSd * ratio) - std::log(kOffsetSd_mg);
    }
    f.other_nats = other - wrong;
  }
  if (nats > kAccept && f.other_nats > 0) {
    alarm(z,
          fmt::format("scale: the gains are those of a unit of {:g} LSB/g, the protocol says {:g}",
                      kCoarse_lsb_per_g, bundle_.accel_scale_lsb_per_g));
    return;
  }
  if (allowed("filter_mismatch")) {
    if (f.nats > kAccept) {
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
}

}  // namespace sixpoint::gap
