#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "gap/explain/catalogue.h"
#include "gap/explain/slow_structure.h"
#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// Nats that are set, not computed: an effect of the best explanation counts as present, one that is
// not in it or fails a later test as absent, and one that was never tried as hardly possible.
constexpr double kPresent_nats = 0.1;
constexpr double kAbsent_nats = -0.1;
constexpr double kNeverTried_nats = -5;
// Beside scatter of an unknown kind only effects this strong count.
constexpr double kStandsOut_nats = 50;
// From here on an effect is certain beside a change of another parameter: by this much, a tenth of
// its evidence pays for the change.
constexpr double kCertain_nats = 20;
constexpr double kPaysForChange = 0.1;
// What a free spectrum costs, against the best slow noise.
constexpr double kFreeSpectrumCost_nats = 4;
constexpr double kTauShare = 0.2;           // relative uncertainty of a time constant
constexpr double kScatterSizeShare = 0.12;  // and of a scatter's size
// Effects that are at most so much less likely could stand in for one that has at most so much
// evidence itself.
constexpr double kStandIn_nats = -3;
constexpr double kConfoundable_nats = 12;
// From this gain on something is there, also where no part of the explanation is accepted.
constexpr double kMuch_nats = 6;
constexpr double kSeveralAlike_sd = 2;

// An alarm for another cause that has won: above any test of the residuals.
double other_wins_sd(double nats) { return nats_to_sd(nats) + kAlarm_sd; }

// Up to where an effect bends from its slope over temperature, as a square: twice kBend, a zero
// more.
struct Bend {
  const char* effect;
  const char* what;
  double curve_share;  // of the slope, per degree
  double least_curve;  // in the effect's unit per degree
};
constexpr std::array kBends = {Bend{"offset_tempco", "zero", 0.04, 0.004},
                               Bend{"sensitivity_tempco", "gain", 2 * kBend / kBend_c, 2e-4}};
constexpr double kCubicShare = 2 * kBend / (kBend_c * kBend_c);

// Whether the effect bends over temperature by significantly more than that.
bool bends_beyond(const Fit& fit, const Bend& bend) {
  constexpr double kPrior_sd = 4;
  constexpr double kSurely_sd = 3;
  Eigen::Index at = kNuisanceParameters;
  for (const ParameterGroup& group : fit.groups) {
    if (group.effect == bend.effect) {
      const double slope = fit.posterior.mean.segment<3>(at).cwiseAbs().maxCoeff();
      const double curve = std::max(bend.least_curve, bend.curve_share * slope);
      const double cubic = std::max(bend.least_curve / kBend_c, kCubicShare * slope);
      for (int i = 3; i < group.count; ++i) {
        const double most = std::min(kPrior_sd * group.sd_of(i), i < 6 ? curve : cubic);
        const double sd = std::sqrt(fit.posterior.covariance(at + i, at + i));
        if (std::abs(fit.posterior.mean[at + i]) - kSurely_sd * sd > most) {
          return true;
        }
      }
    }
    at += group.count;
  }
  return false;
}

// Whether the drift ripples significantly more than belongs to it; kRippleShare of it does, and of
// the smallest realistic drift always.
bool drift_ripples(const Fit& fit) {
  constexpr double kBeyond = 2;
  constexpr double kSurely_sd = 3;
  Eigen::Index at = kNuisanceParameters;
  for (const ParameterGroup& group : fit.groups) {
    if (group.effect == "drift") {
      const double drift_mg_per_h =
          std::max(group.smallest, fit.state.drift_mg_per_h.cwiseAbs().maxCoeff());
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        double square = 0;
        double variance = 0;
        for (Eigen::Index i = at + 3 + axis; i < at + group.count; i += 3) {
          square += std::pow(fit.posterior.mean[i], 2);
          variance += fit.posterior.covariance(i, i);
        }
        if (std::sqrt(square) - kSurely_sd * std::sqrt(variance) >
            kBeyond * kRippleShare * drift_mg_per_h) {
          return true;
        }
      }
    }
    at += group.count;
  }
  return false;
}

// Log likelihood over white noise of one kind of slow noise, along the sizes that were tried.
struct SizeCurve {
  std::vector<double> sizes;  // ascending
  std::vector<double> nats;

  // By the parabola over the logarithm of the size through the three next sizes: straight lines
  // between them would have their maximum on a size that was tried, whatever the true one.
  double at(double size) const {
    if (size >= sizes.back()) {
      return nats.back();
    }
    if (size <= sizes[1]) {  // the first is 0
      return nats[0] + size / sizes[1] * (nats[1] - nats[0]);
    }
    const auto above = std::ranges::upper_bound(sizes, size) - sizes.begin();
    const auto middle =
        static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 2, std::ssize(sizes) - 2));
    double sum = 0;
    for (std::size_t i = middle - 1; i <= middle + 1; ++i) {
      double share = 1;
      for (std::size_t k = middle - 1; k <= middle + 1; ++k) {
        share *= k == i ? 1 : std::log(size / sizes[k]) / std::log(sizes[i] / sizes[k]);
      }
      sum += share * nats[i];
    }
    return sum;
  }
};

SizeCurve curve_of(const SlowNoise& slow, Scatter kind) {
  if (kind == Scatter::flicker) {
    return {slow.flicker_mg, slow.nats[0]};
  }
  SizeCurve walk{slow.walk_mg, {}};
  for (const std::vector<double>& row : slow.nats) {
    walk.nats.push_back(row[0]);
  }
  return walk;
}

// Slow noise has one size, within dwells and between them: log odds of a size of its own for each,
// less the cost of the free number. `size`: between the dwells.
double other_size_nats(const SlowNoise& slow, Scatter kind, double size) {
  constexpr double kCost_nats = 1.5;
  // The two sizes come from different approximations, and other things add to one of them: sizes
  // within a factor of two are the same.
  constexpr double kAlike = 2;
  if (kind == Scatter::seating) {
    return -kCost_nats;
  }
  const SizeCurve curve = curve_of(slow, kind);
  double best = 0;
  double here = std::max(curve.at(size / kAlike), curve.at(size * kAlike));
  for (std::size_t i = 0; i < curve.sizes.size(); ++i) {
    best = std::max(best, curve.nats[i]);
    if (curve.sizes[i] > size / kAlike && curve.sizes[i] < size * kAlike) {
      here = std::max(here, curve.nats[i]);
    }
  }
  return best - here - kCost_nats;
}

// Other effects that would do nearly as well in its place, and those beside it that leave its
// numbers open.
std::vector<std::string> confounded(const Request& request, const Explanation& explanation,
                                    const std::string& name, const Findings& found,
                                    const Findings& before) {
  std::vector<std::string> others;
  const bool weak = explanation.gain_nats(name) < kConfoundable_nats;
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string other(entry.name);
    if (weak && other != name && request.allowed(other) && !found.accepted(other) &&
        !before.accepted(other) && explanation.stand_in_nats(name, other) > kStandIn_nats) {
      others.push_back(other);
    }
  }
  for (std::string& other : explanation.left_open_by(name)) {
    others.push_back(std::move(other));
  }
  if (name == "local_gravity") {
    others.emplace_back("gain");
  }
  return others;
}

std::vector<NamedValue> parameters_of(const std::string& name,
                                      const Explanation::Estimate& estimate) {
  std::vector<NamedValue> parameters;
  if (name != "truncation") {
    std::vector<double> value = estimate.value;
    std::vector<double> sd = estimate.sd;
    std::vector<double> form_sd(sd.size());
    for (std::size_t i = 0; i < sd.size(); ++i) {
      form_sd[i] = std::abs(kFormShare * value[i]);
      sd[i] = std::hypot(sd[i], form_sd[i]);
      value[i] += absent_value(name);
    }
    parameters.push_back(
        {parameter_name(name), std::move(value), std::move(sd), std::move(form_sd)});
  }
  if (name == "tilt") {
    const double angle = std::hypot(estimate.value[0], estimate.value[1]);
    // A turn about the vertical: gravity does not show it, and motion was not asked.
    parameters[0].value.push_back(0);
    parameters[0].sd.push_back(NAN);
    parameters[0].form_sd.push_back(0);
    parameters.push_back({"angle_deg", {angle}, {std::max(estimate.sd[0], estimate.sd[1])}});
  }
  if (name == "warm_up") {
    parameters.push_back({"tau_s", {estimate.tau_s}, {kTauShare * estimate.tau_s}});
  }
  return parameters;
}

// The largest log odds of any parameter that changes; alarms for those that win.
double judge_changes(const Explanation& explanation, Findings& found) {
  double most = kExcluded_nats;
  for (const Inconstancy& change : explanation.inconstancies()) {
    const double nats = change.nats + kLogPriorUnknown;
    most = std::max(most, nats);
    found.suspect(nats);
    if (nats > kUnknownWins_nats) {
      found.alarm(other_wins_sd(change.nats),
                  fmt::format("mean: {} changes with {}", change.term, change.factor));
    }
  }
  return most;
}

// Log odds of other causes in the place of an accepted effect. `changing`: of any change.
double other_causes(const Explanation& explanation, const EffectFinding& f, double changing,
                    Findings& found) {
  double other = std::min(
      changing, kUnknownWins_nats - kPaysForChange * std::max(0.0, f.nats - kCertain_nats));
  if (f.name != "drift" && f.name != "warm_up") {
    const double grows = explanation.changing_nats(f.name) + kLogPriorUnknown;
    found.suspect(grows);
    if (grows > kUnknownWins_nats) {
      found.alarm(other_wins_sd(grows),
                  fmt::format("mean: {} that changes while the recording runs", f.name));
    }
    other = std::max(other, grows);
  }
  for (const Bend& bend : kBends) {
    if (f.name == bend.effect && bends_beyond(explanation.best(), bend)) {
      found.alarm(
          2 * kAlarm_sd,
          fmt::format("mean: the {} bends over temperature more than its drift does", bend.what));
      other = kUnknownWins_nats;
    }
  }
  if (f.name == "drift" && drift_ripples(explanation.best())) {
    found.alarm(2 * kAlarm_sd, "mean: the zero wanders with time more than a drift does");
    other = kUnknownWins_nats;
  }
  return other;
}

std::size_t learnt_from(const std::vector<LearntSize>& learnt, const std::string& name) {
  const auto found = std::find_if(learnt.begin(), learnt.end(),
                                  [&](const LearntSize& size) { return size.effect == name; });
  return found == learnt.end() ? 0 : found->units;
}

void judge_effect(const Request& request, const Explanation& explanation, const std::string& name,
                  double changing, const Findings& before, Findings& found) {
  const auto estimate = explanation.estimate(name);
  if (!estimate) {
    return;
  }
  if (const std::optional<double> bound = explanation.bound(name)) {
    found.bounds[name] = *bound;
  }
  const bool in = explanation.best().contains(name);
  const double gain = explanation.gain_nats(name);
  EffectFinding f{.name = name,
                  .nats = in ? std::max(kPresent_nats, gain) : std::min(kAbsent_nats, gain),
                  .parameters = parameters_of(name, *estimate),
                  .held_out_gain_nats = explanation.held_out_nats(name),
                  .learnt_from_units = learnt_from(request.options.learnt, name)};
  if (in) {
    f.confounded_with = confounded(request, explanation, name, found, before);
    // It must stand out beside unknown scatter, and help where it was not fitted.
    if ((explanation.unknown_wins() && f.nats < kStandsOut_nats) || f.held_out_gain_nats <= 0) {
      f.nats = kAbsent_nats;
    }
    f.other_nats = other_causes(explanation, f, changing, found);
  }
  found.add(request, std::move(f));
}

// Random effects: scatter of the whole recording, which must have the structure of its kind.
void judge_scatter(const Request& request, const Explanation& explanation, const SlowNoise& slow,
                   Scatter kind, Findings& found) {
  const std::string name(to_string(kind));
  const auto in_records = [&](double size, double tried) {
    return kind == Scatter::seating ? 0 : slow.expected_nats(kind == Scatter::flicker, size, tried);
  };
  if (const std::optional<double> bound = explanation.bound(kind, in_records)) {
    found.bounds[name] = *bound;
  }
  const Fit& fit = explanation.best();
  const double size = fit.size_of(kind);
  const bool in = size > 0;
  const double gain = explanation.gain_nats(name, in);
  EffectFinding f{.name = name,
                  .nats = in          ? std::max(kPresent_nats, gain)
                          : gain == 0 ? kNeverTried_nats
                                      : std::min(kAbsent_nats, gain),
                  .parameters = {{parameter_name(name), {size}, {kScatterSizeShare * size}}},
                  .held_out_gain_nats = in ? gain : std::min(0.0, gain)};
  if (kind == Scatter::flicker) {
    // The floor of the Allan deviation: its square is 2 ln 2 times the density at 1 Hz (Riley, NIST
    // Special Publication 1065, 2008).
    const double floor_mg = std::sqrt(2 * M_LN2) * size;
    f.parameters.push_back({"floor_mg", {floor_mg}, {kScatterSizeShare * floor_mg}});
  }
  if (in) {
    const SlowStructure structure = kind == Scatter::seating
                                        ? SlowStructure{}
                                        : slow_structure(explanation.model().blocks(), fit, slow,
                                                         explanation.model().options().lsb_mg);
    f.other_nats = std::max(explanation.unknown_nats(), structure.other_nats);
    found.suspect(f.other_nats);
    const double other_size = other_size_nats(slow, kind, size) + kLogPriorUnknown;
    // Even odds are enough for another cause: then neither is named.
    if (other_size > std::max(0.0, f.other_nats)) {
      found.alarm(other_wins_sd(other_size),
                  fmt::format("mean: {} between dwells, but not of that size within them", name));
      f.other_nats = other_size;
      f.nats = kAbsent_nats;
    } else if (f.other_nats > 0) {
      found.alarm(other_wins_sd(f.other_nats),
                  structure.other_nats >= f.other_nats
                      ? "mean: slow, but " + structure.other
                      : fmt::format("mean: scatter by {}, or {}",
                                    to_string(explanation.best_unknown()->scatter), name));
      f.nats = kAbsent_nats;
    }
  }
  found.add(request, std::move(f));
}

}  // namespace

Explanation explain(const Request& request, const std::vector<Block>& blocks,
                    const SlowNoise& slow) {
  const auto record_nats = [&slow](Scatter scatter, double size) {
    switch (scatter) {
      case Scatter::random_walk:
      case Scatter::flicker:
        return curve_of(slow, scatter).at(size);
      case Scatter::by_time:
      case Scatter::by_time_fast:
        // Unknown in time: any spectrum that the records show.
        return std::max({0.0, slow.best().nats - kFreeSpectrumCost_nats, slow.free_nats});
      default:
        return 0.0;
    }
  };
  return Explanation(blocks, {request.lsb_mg(),
                              [&request](const std::string& name) { return request.allowed(name); },
                              record_nats, request.options.learnt});
}

Findings judge_means(const Request& request, const Explanation& explanation, const SlowNoise& slow,
                     const Findings& before) {
  Findings found;
  const Fit& fit = explanation.best();
  const double changing = judge_changes(explanation, found);
  // Every linear effect becomes a candidate, judged against the best explanation.
  std::set<std::string> names;
  for (const ParameterGroup& group : parameter_groups()) {
    if (group.effect != "gain" && group.effect != "offset" && request.allowed(group.effect)) {
      names.insert(group.effect);
    }
  }
  for (const std::string& name : names) {
    judge_effect(request, explanation, name, changing, before, found);
  }
  if (const double nats = explanation.changing_nats("gain") + kLogPriorUnknown;
      nats > kUnknownWins_nats) {
    found.alarm(other_wins_sd(nats), "mean: gains that change while the recording runs");
  }
  for (const Scatter kind : {Scatter::seating, Scatter::random_walk, Scatter::flicker}) {
    if (request.allowed(std::string(to_string(kind)))) {
      judge_scatter(request, explanation, slow, kind, found);
    }
  }
  // Nothing separates it from an offset of half an LSB: what is known is the prior.
  found.add(request,
            {.name = "rounding_floor", .nats = kLogPriorEffect, .confounded_with = {"offset"}});
  // What explains much, but so do others, is there all the same.
  const double much = fit.nats - explanation.nominal().nats;
  const bool quiet = before.alarms.empty() && found.alarms.empty();
  const auto unnamed = [&] {
    return quiet && much > kMuch_nats &&
           std::none_of(found.effects.begin(), found.effects.end(), [&](const EffectFinding& e) {
             return e.name == to_string(fit.scatter) || fit.contains(e.name) ||
                    (fit.seats_deg > 0 && e.name == to_string(Scatter::seating));
           });
  };
  found.accept_likely(before.effects.size(), unnamed());
  if (unnamed()) {
    found.alarm(nats_to_sd(much) + kSeveralAlike_sd, "mean: several explanations do alike");
  }
  const std::map<std::string, double> gap_mg2 = explanation.gap_mg2();
  for (auto* list : {&found.effects, &found.candidates}) {
    for (EffectFinding& f : *list) {
      const auto own = gap_mg2.find(f.name);
      f.gap_mg2 = own == gap_mg2.end() ? 0 : own->second;
    }
  }
  return found;
}

}  // namespace sixpoint::gap
