#include "gap/judge/findings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {
namespace {

// Log odds beyond these say no more: e^9 is 8000 to one.
constexpr double kLeast_nats = -40;
constexpr double kMost_nats = 9;

// Of something unknown, without and with much evidence, and how fast it grows between: fitted on
// realistic units and outside kinds (docs/gap.md, Conventions).
constexpr double kQuietProbability = 0.03;
constexpr double kAlarmProbability = 0.95;
constexpr double kUnknownWidth_sd = 0.6;
// Share of names that are right beside something that the catalogue lacks, which often looks like
// what is named. Convention, near what was measured (docs/gap.md): of first names 46 of 92 were of
// the right family beside one outside kind, 23 of 32 where the true effects were withheld.
constexpr double kRightBesideUnknown = 0.5;

bool contains(const std::vector<EffectFinding>& list, const std::string& name) {
  return std::any_of(list.begin(), list.end(),
                     [&](const EffectFinding& f) { return f.name == name; });
}

// Adds what no step has judged, in the catalogue's order; strongest first.
void complete(const DiagnoseOptions& options, Findings& found) {
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string name(entry.name);
    if (is_allowed(options, name) && !contains(found.candidates, name)) {
      found.candidates.push_back(
          {.name = name, .probability = probability_of(kLogPriorEffect), .nats = kLogPriorEffect});
    }
  }
  for (auto* list : {&found.effects, &found.candidates}) {
    std::stable_sort(
        list->begin(), list->end(),
        [](const EffectFinding& a, const EffectFinding& b) { return a.nats > b.nats; });
    for (EffectFinding& f : *list) {
      if (const auto bound = found.bounds.find(f.name); bound != found.bounds.end()) {
        f.bound = bound->second;
      }
      const CatalogueEntry* entry = find_entry(f.name);
      if (entry != nullptr && entry->datasheet > 0 && !f.parameters.empty()) {
        const std::vector<double>& values = f.parameters.front().value;
        f.outside_datasheet |= std::any_of(
            values.begin(), values.end(), [&](double v) { return std::abs(v) > entry->datasheet; });
      }
    }
  }
}

// Relative uncertainty of a size: that of its first parameter, taken together over the axes.
double relative_sd(const EffectFinding& f) {
  constexpr double kUnknown = 0.3;  // convention, where none is given
  double value2 = 0, sd2 = 0;
  if (!f.parameters.empty()) {
    for (const double v : f.parameters.front().value) {
      value2 += v * v;
    }
    for (const double sd : f.parameters.front().sd) {
      sd2 += std::isnan(sd) ? 0 : sd * sd;
    }
  }
  return value2 > 0 && sd2 > 0 ? std::sqrt(sd2 / value2) : kUnknown;
}

double probability_it_matters(const EffectFinding& f, double matters_mg) {
  const double rms_mg = std::sqrt(std::max(0.0, f.gap_mg2));
  const double z = rms_mg > 0 ? (rms_mg - matters_mg) / (rms_mg * relative_sd(f)) : -10;
  return f.probability * 0.5 * std::erfc(-z / M_SQRT2);
}

// From 0 to 1: monotone in the strongest evidence for something unknown, steepest where that
// alarms.
double unknown_share(const Findings& found) {
  double sd = found.worst_sd;
  for (const Alarm& alarm : found.alarms) {
    sd = std::max(sd, alarm.sd);
  }
  return 1 / (1 + std::exp(-(sd - kAlarm_sd) / kUnknownWidth_sd));
}

// Comparisons with what is no number are false: it would pass for no alarm and no gap.
bool is_finite(const Findings& found, const GapSize& gap) {
  const auto finite = [](const EffectFinding& f) {
    return std::isfinite(f.nats) && std::isfinite(f.gap_mg2);
  };
  return std::ranges::all_of(found.candidates, finite) &&
         std::ranges::all_of(found.effects, finite) && std::isfinite(gap.before_mg) &&
         std::isfinite(gap.after_mg) && std::isfinite(gap.floor_mg);
}

}  // namespace

double probability_of(double nats) {
  return 1 / (1 + std::exp(-std::clamp(nats, kLeast_nats, kMost_nats)));
}

double chi_to_sd(double chi, double freedom) {
  if (freedom < 1) {
    return 0;
  }
  const double s = 2 / (9 * freedom);
  return (std::cbrt(chi / freedom) - (1 - s)) / std::sqrt(s);
}

std::vector<UnknownPlace> noise_places(const Request& request, int axis) {
  std::set<std::string> names;
  for (const Segment& segment : request.bundle.segments) {
    if (segment.at_rest()) {
      names.insert(segment.name);
    }
  }
  std::vector<UnknownPlace> places;
  for (const std::string& name : names) {
    for (int a = 0; a < 3; ++a) {
      if (axis < 0 || a == axis) {
        places.push_back({a, name, "noise"});
      }
    }
  }
  return places;
}

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

void Findings::add(const Request& request, EffectFinding finding) {
  if (!request.allowed(finding.name)) {
    return;
  }
  finding.probability =
      1 / (1 / probability_of(finding.nats) + std::exp(std::min(kMost_nats, finding.other_nats)));
  if (finding.nats > kAccept_nats) {
    effects.push_back(finding);
  }
  candidates.push_back(std::move(finding));
}

void Findings::test(double sd, const std::string& where, const std::vector<UnknownPlace>& places) {
  worst_sd = std::max(worst_sd, sd);
  if (sd > kAlarm_sd) {
    alarm(sd, where, places);
  }
}

void Findings::suspect(double nats) {
  constexpr double kSdPerNat = 1.0 / 3;
  worst_sd = std::max(worst_sd, kAlarm_sd + kSdPerNat * (nats - kUnknownWins_nats));
}

void Findings::append(Findings later) {
  const auto join = [](auto& list, auto& more) {
    list.insert(list.end(), std::make_move_iterator(more.begin()),
                std::make_move_iterator(more.end()));
  };
  join(effects, later.effects);
  join(candidates, later.candidates);
  join(alarms, later.alarms);
  join(outside_means, later.outside_means);
  worst_sd = std::max(worst_sd, later.worst_sd);
  bounds.merge(later.bounds);
}

bool Findings::accepted(const std::string& effect) const { return contains(effects, effect); }

void Findings::accept_likely(std::size_t before, bool unnamed) {
  if (!unnamed && before + effects.size() < kManyEffects) {
    return;
  }
  for (const EffectFinding& f : candidates) {
    if (f.nats > kAcceptAmongMany_nats && !accepted(f.name)) {
      effects.push_back(f);
    }
  }
}

void set_shares(const Diagnosis& out, double matters_mg, std::vector<EffectFinding>& effects,
                std::vector<EffectFinding>& candidates) {
  double whole_mg2 = out.unknown.size_mg * out.unknown.size_mg;
  for (const EffectFinding& f : effects) {
    whole_mg2 += std::max(0.0, f.gap_mg2);
  }
  if (effects.empty()) {
    whole_mg2 = out.gap.before_mg * out.gap.before_mg - out.gap.floor_mg * out.gap.floor_mg;
  }
  for (auto* list : {&effects, &candidates}) {
    for (EffectFinding& f : *list) {
      f.share_of_gap = whole_mg2 > 0 ? std::clamp(f.gap_mg2 / whole_mg2, 0.0, 1.0) : 0;
      f.probability_it_matters = probability_it_matters(f, matters_mg);
    }
  }
}

void finish(const Request& request, Findings found, Diagnosis& out) {
  if (!is_finite(found, out.gap)) {
    out.gap = {};
    out.where.clear();
    out.next_segments.clear();
    out.plots = {};
    out = inconclusive(
        request.options, std::move(found),
        "a result is no finite number: times or values of the recording lie beyond what "
        "can be computed",
        std::move(out));
    return;
  }
  complete(request.options, found);
  std::sort(found.alarms.begin(), found.alarms.end(),
            [](const Alarm& a, const Alarm& b) { return a.sd > b.sd; });
  constexpr std::size_t kMostPlaces = 8;
  for (std::size_t i = 0; i < std::min(kMostPlaces, found.alarms.size()); ++i) {
    out.unknown.why.push_back(found.alarms[i].where);
  }
  out.unknown.present = !found.alarms.empty();
  const double share = unknown_share(found);
  out.unknown.probability = kQuietProbability + (kAlarmProbability - kQuietProbability) * share;
  for (auto* list : {&found.effects, &found.candidates}) {
    for (EffectFinding& f : *list) {
      f.probability *= 1 - (1 - kRightBesideUnknown) * share;
    }
  }
  out.unknown.size_mg =
      out.unknown.present
          ? std::sqrt(std::max(0.0, std::pow(out.gap.after_mg, 2) - std::pow(out.gap.floor_mg, 2)))
          : 0;
  // Strongest first: by what they close of the gap; evidence says only how sure they are.
  std::stable_sort(
      found.effects.begin(), found.effects.end(),
      [](const EffectFinding& a, const EffectFinding& b) { return a.gap_mg2 > b.gap_mg2; });
  set_shares(out, request.options.matters_mg, found.effects, found.candidates);
  out.verdict = out.unknown.present
                    ? (found.effects.empty() ? Verdict::unexplained : Verdict::partly_explained)
                    : (found.effects.empty() ? Verdict::no_gap : Verdict::explained);
  out.effects = std::move(found.effects);
  out.candidates = std::move(found.candidates);
}

Diagnosis inconclusive(const DiagnoseOptions& options, Findings found, const std::string& why,
                       Diagnosis out) {
  constexpr double kProbability = 0.5;  // nothing is known
  out.inconclusive = true;
  out.losses.push_back(why);
  // A recording that is held or zero throughout has several possible causes: none is named.
  out.effects.clear();
  for (EffectFinding& candidate : found.candidates) {
    // What is no number is as likely as not.
    candidate.nats = std::isnan(candidate.nats) ? 0 : std::min(candidate.nats, 0.0);
    candidate.probability = std::min(kProbability, candidate.probability);
  }
  complete(options, found);
  out.candidates = std::move(found.candidates);
  out.verdict = Verdict::unexplained;
  out.unknown = {true, kProbability, {why}, {}};
  out.not_observable.clear();
  for (const CatalogueEntry& entry : catalogue()) {
    if (is_allowed(options, std::string(entry.name))) {
      out.not_observable.emplace_back(entry.name, entry.segment.empty() ? "none" : entry.segment);
    }
  }
  return out;
}

}  // namespace sixpoint::gap
