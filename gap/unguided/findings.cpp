#include "gap/unguided/findings.h"

#include <algorithm>
#include <cmath>

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {

void set_sigmas(GapSize& gap) {
  gap.before_sigma = gap.before_mg / gap.floor_mg;
  gap.after_sigma = gap.after_mg / gap.floor_mg;
}

double closed_fraction(const GapSize& gap) {
  return std::clamp(1 - std::pow(gap.after_mg / gap.before_mg, 2), 0.0, 1.0);
}

void finish(Diagnosis& diagnosis, const DiagnoseOptions& options) {
  // Six faces and back: 1.7 minutes, 12 placements of 0.135 nats each.
  diagnosis.next_segments.push_back(
      {"faces", 1.7, 0.135 * 12, {"misalignment", "second_order", "settling"}});
  if (diagnosis.inconclusive) {
    Findings found;
    found.candidates = std::move(diagnosis.candidates);
    const std::string why = diagnosis.unknown.why.front();
    diagnosis = inconclusive(options, std::move(found), why, std::move(diagnosis));
    return;
  }
  const std::vector<EffectFinding> judged = diagnosis.candidates;
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string name(entry.name);
    if (is_allowed(options, name) &&
        std::ranges::find(judged, name, &EffectFinding::name) == judged.end()) {
      EffectFinding finding;
      finding.name = name;
      finding.nats = kLogPriorEffect;
      finding.probability = 0.03;  // of the prior alone
      diagnosis.candidates.push_back(std::move(finding));
      diagnosis.not_observable.emplace_back(
          name, entry.segment.empty() ? "none" : std::string(entry.segment));
    }
  }
  if (diagnosis.unknown.present) {
    const GapSize& gap = diagnosis.gap;
    diagnosis.unknown.size_mg =
        std::sqrt(std::max(0.0, std::pow(gap.after_mg, 2) - std::pow(gap.floor_mg, 2)));
  }
  set_shares(diagnosis, options.matters_mg, diagnosis.effects, diagnosis.candidates);
  diagnosis.unknown.probability = diagnosis.unknown.present ? 0.95 : 0.1;
  diagnosis.verdict =
      diagnosis.unknown.present
          ? (diagnosis.effects.empty() ? Verdict::unexplained : Verdict::partly_explained)
          : (diagnosis.effects.empty() ? Verdict::no_gap : Verdict::explained);
}

}  // namespace sixpoint::gap
