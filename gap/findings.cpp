#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

namespace {

double logistic(double nats) { return 1 / (1 + std::exp(-std::clamp(nats, -40.0, 9.0))); }

}  // namespace

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

void Diagnoser::find(EffectFinding finding) {
  finding.probability =
      1 / (1 / logistic(finding.nats) + std::exp(std::min(9.0, finding.other_nats)));
  if (!allowed(finding.name)) {
    return;
  }
  if (finding.nats > kAccept) {
    out_.effects.push_back(finding);
  }
  out_.candidates.push_back(std::move(finding));
}

Diagnosis Diagnoser::give_up(const std::string& why) {
  out_.inconclusive = true;
  out_.losses.push_back(why);
  // A recording that is held or zero throughout has several causes: none is named.
  out_.effects.clear();
  for (EffectFinding& candidate : out_.candidates) {
    candidate.nats = std::min(candidate.nats, 0.0);
    candidate.probability = std::min(candidate.probability, 0.5);
  }
  out_.verdict = Verdict::unexplained;
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

void Diagnoser::complete_candidates() {
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

void Diagnoser::finish() {
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
    out_.unknown.probability = 0.03 + 0.3 * std::clamp((worst_sd_ - 3) / (kAlarm_sd - 3), 0.0, 1.0);
  } else {
    out_.unknown.probability = std::min(0.999, 0.9 + 0.02 * (alarms_.front().first - kAlarm_sd));
  }
  const bool any = !out_.effects.empty();
  out_.verdict = out_.unknown.present ? (any ? Verdict::partly_explained : Verdict::unexplained)
                                      : (any ? Verdict::explained : Verdict::no_gap);
}

}  // namespace sixpoint::gap
