#include "gap/adopt/rule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "sim/effects/effect.h"

namespace sixpoint::gap {

namespace {

constexpr double kBeyondZero = 2;  // standard uncertainties

// What the documents of one unit say of one effect.
struct UnitVotes {
  std::size_t able = 0;
  std::size_t naming = 0;
  std::vector<const EffectEvidence*> named;  // by those
  std::vector<const EffectEvidence*> sized;  // by all that can show it
  bool names() const { return 2 * naming > able; }
};
using Votes = std::map<std::string, UnitVotes>;  // by serial number

const EffectEvidence* find(const DocumentEvidence& document, const std::string& name) {
  const auto found = std::ranges::find_if(
      document.effects, [&](const EffectEvidence& effect) { return effect.name == name; });
  return found == document.effects.end() ? nullptr : &*found;
}

bool can_show(const DocumentEvidence& document, const std::string& name) {
  return std::ranges::find(document.not_observable, name) == document.not_observable.end();
}

Votes votes_on(const std::string& name, const std::vector<DocumentEvidence>& documents,
               const AdoptionOptions& options) {
  Votes votes;
  for (const DocumentEvidence& document : documents) {
    const EffectEvidence* effect = find(document, name);
    const bool named = effect != nullptr && effect->named;
    if (document.inconclusive || document.unknown || !(named || can_show(document, name))) {
      continue;
    }
    UnitVotes& unit = votes[document.serial];
    ++unit.able;
    if (effect != nullptr) {
      unit.sized.push_back(effect);
    }
    if (named && effect->probability >= options.least_probability) {
      ++unit.naming;
      unit.named.push_back(effect);
    }
  }
  return votes;
}

const NamedValue* find(const EffectEvidence& effect, const sim::Parameter& parameter) {
  const auto found = std::ranges::find_if(
      effect.parameters, [&](const NamedValue& p) { return p.name == parameter.name; });
  return found == effect.parameters.end() || found->value.size() != parameter.default_value.size()
             ? nullptr
             : &*found;
}

// The sign of a line is its phase: all are turned to the side of the longest.
double side_of(const NamedValue& p, const std::vector<double>& longest) {
  double product = 0;
  for (std::size_t i = 0; i < p.value.size(); ++i) {
    product += p.value[i] * longest[i];
  }
  return product < 0 ? -1 : 1;
}

std::vector<double> longest_of(const std::vector<std::vector<const NamedValue*>>& units) {
  std::vector<double> longest;
  double most = -1;
  for (const auto& unit : units) {
    for (const NamedValue* p : unit) {
      double square = 0;
      for (const double x : p->value) {
        square += x * x;
      }
      if (square > most) {
        most = square;
        longest = p->value;
      }
    }
  }
  return longest;
}

// Values of one parameter, per unit; units without any are left out.
std::vector<std::vector<const NamedValue*>> values_of(
    const std::vector<std::vector<const EffectEvidence*>>& units, const sim::Parameter& parameter) {
  std::vector<std::vector<const NamedValue*>> values;
  for (const auto& unit : units) {
    std::vector<const NamedValue*> own;
    for (const EffectEvidence* effect : unit) {
      if (const NamedValue* p = find(*effect, parameter); p != nullptr) {
        own.push_back(p);
      }
    }
    if (!own.empty()) {
      values.push_back(std::move(own));
    }
  }
  return values;
}

// Of one number of a document: what scatters, without the part that all units share.
double scatter_of(const NamedValue& p, std::size_t i) {
  if (p.sd.empty()) {
    return 0;
  }
  const double form = p.form_sd.empty() ? 0 : p.form_sd[i];
  return std::sqrt(std::max(0.0, p.sd[i] * p.sd[i] - form * form));
}

AdoptedNumber pooled(const sim::Parameter& parameter,
                     const std::vector<std::vector<const NamedValue*>>& units) {
  const std::vector<double> longest = longest_of(units);
  const bool is_line = parameter.name == "vector_mg";
  AdoptedNumber out{parameter.name, {}};
  for (std::size_t i = 0; i < parameter.default_value.size(); ++i) {
    std::vector<double> value;
    std::vector<double> sd;
    // Mean over all documents, with the sign of the size: the effect differs from its law by one
    // share in all of them, which no number of units averages out.
    double form = 0;
    double documents = 0;
    for (const auto& unit : units) {
      std::vector<double> own;
      std::vector<double> own_sd;
      for (const NamedValue* p : unit) {
        own.push_back(p->value[i] * (is_line ? side_of(*p, longest) : 1));
        own_sd.push_back(scatter_of(*p, i));
        form += p->form_sd.empty() ? 0 : std::copysign(p->form_sd[i], own.back());
        documents += 1;
      }
      const MeanAndSpread together = mean_and_spread(own, own_sd);
      value.push_back(together.mean);
      sd.push_back(together.standard_uncertainty);
    }
    MeanAndSpread all = mean_and_spread(value, sd);
    all.standard_uncertainty = std::hypot(all.standard_uncertainty, form / documents);
    out.numbers.push_back(all);
  }
  return out;
}

// Of all numbers together: one of several is easily two uncertainties off by chance.
bool about_zero(const AdoptedNumber& size) {
  double square = 0;
  double numbers = 0;
  for (const MeanAndSpread& n : size.numbers) {
    if (n.mean != 0) {
      square += std::pow(n.mean / n.standard_uncertainty, 2);
      numbers += 1;
    }
  }
  return square <= kBeyondZero * kBeyondZero * numbers;
}

// The matrix of axis_rotation is a setting: there is none between two of them.
bool is_matrix(const sim::Parameter& parameter) { return parameter.default_value.size() == 9; }

bool all_alike(const AdoptedNumber& setting) {
  constexpr double kSame = 1e-6;
  return std::ranges::all_of(setting.numbers,
                             [](const MeanAndSpread& n) { return n.spread.value_or(0) < kSame; });
}

// Sets the numbers; false where there is no mean.
bool take_numbers(const sim::EffectKind& kind, const Votes& votes, AdoptionDecision& out) {
  std::vector<std::vector<const EffectEvidence*>> naming;
  std::vector<std::vector<const EffectEvidence*>> all;
  const bool everywhere = every_unit_has_some(kind.name);
  for (const auto& [serial, unit] : votes) {
    all.push_back(unit.sized);
    if (unit.names()) {
      naming.push_back(unit.named);
    }
  }
  for (const auto& unit : everywhere ? all : naming) {
    out.bundles += unit.size();
  }
  out.share_of_units = everywhere
                           ? 1
                           : static_cast<double>(out.units_naming) /
                                 static_cast<double>(std::max<std::size_t>(1, out.units_able));
  bool size = true;
  for (const sim::Parameter& parameter : kind.parameters) {
    const auto values = values_of(size && everywhere ? all : naming, parameter);
    if (!values.empty()) {
      out.parameters.push_back(pooled(parameter, values));
      if (is_matrix(parameter) && !all_alike(out.parameters.back())) {
        return false;
      }
    }
    size = false;
  }
  return true;
}

// The mean of the sizes is not told from 0: it is 0, and the spread is about that.
void centre(AdoptedNumber& size) {
  for (MeanAndSpread& n : size.numbers) {
    n.spread = std::hypot(n.spread.value_or(0), n.mean);
    n.mean = 0;
  }
}

AdoptionDecision decide(const std::string& name, const std::vector<DocumentEvidence>& documents,
                        std::size_t units, const AdoptionOptions& options) {
  AdoptionDecision out;
  out.name = name;
  const auto kind = sim::find_effect(name);
  if (!kind) {
    out.outcome = AdoptionOutcome::not_simulated;
    return out;
  }
  const Votes votes = votes_on(name, documents, options);
  for (const auto& [serial, unit] : votes) {
    ++out.units_able;
    out.units_naming += unit.names() ? 1 : 0;
  }
  const bool beside_unknown = std::ranges::any_of(documents, [&](const DocumentEvidence& document) {
    const EffectEvidence* effect = find(document, name);
    return document.unknown && effect != nullptr && effect->named;
  });
  if (votes.empty() && !beside_unknown) {
    out.outcome = AdoptionOutcome::not_observable;
  } else if (out.units_naming == 0) {
    out.outcome = beside_unknown ? AdoptionOutcome::unknown_beside : AdoptionOutcome::not_named;
  } else if (units > 1 && out.units_naming < options.least_units) {
    out.outcome = AdoptionOutcome::its_own;
  } else if (!take_numbers(**kind, votes, out)) {
    out.outcome = AdoptionOutcome::no_mean;
  } else if (units == 1) {
    out.outcome = AdoptionOutcome::one_unit;
  } else if (!out.parameters.empty() && (*kind)->parameters.front().low < 0 &&
             !is_matrix((*kind)->parameters.front()) && about_zero(out.parameters.front())) {
    out.outcome = AdoptionOutcome::spread_only;
    centre(out.parameters.front());
  } else {
    out.outcome = AdoptionOutcome::adopted;
  }
  return out;
}

}  // namespace

std::string_view to_string(AdoptionOutcome outcome) {
  constexpr std::array<std::string_view, 9> kNames = {
      "adopted",        "spread_only",    "one_unit", "its_own",      "not_named",
      "unknown_beside", "not_observable", "no_mean",  "not_simulated"};
  return kNames[static_cast<std::size_t>(outcome)];
}

std::string AdoptionDecision::brief() const {
  switch (outcome) {
    case AdoptionOutcome::adopted:
      return fmt::format("adopted: {} of {} units name it", units_naming, units_able);
    case AdoptionOutcome::spread_only:
      return fmt::format("adopted as a spread: {} of {} units name it, and they differ in sign",
                         units_naming, units_able);
    case AdoptionOutcome::one_unit:
      return "adopted from one unit: how units differ is not known";
    case AdoptionOutcome::its_own:
      return fmt::format("not adopted: {} of {} units has it, so it is its own", units_naming,
                         units_able);
    case AdoptionOutcome::not_named:
      return "not adopted: no unit has it for certain";
    case AdoptionOutcome::unknown_beside:
      return "not adopted: named only beside something unknown";
    case AdoptionOutcome::not_observable:
      return "not adopted: no protocol among the documents can show it";
    case AdoptionOutcome::no_mean:
      return "not adopted: the units' settings differ, and have no mean";
    case AdoptionOutcome::not_simulated:
      return "not adopted: the simulator has no such effect";
  }
  return {};
}

std::vector<AdoptionDecision> decide_adoption(const std::vector<DocumentEvidence>& documents,
                                              const AdoptionOptions& options) {
  std::vector<DocumentEvidence> sorted = documents;
  std::ranges::sort(sorted, {}, &DocumentEvidence::id);
  std::set<std::string> names;
  std::set<std::string> units;
  for (const DocumentEvidence& document : sorted) {
    for (const EffectEvidence& effect : document.effects) {
      names.insert(effect.name);
    }
    if (!document.inconclusive) {
      units.insert(document.serial);
    }
  }
  std::vector<AdoptionDecision> decisions;
  decisions.reserve(names.size());
  for (const std::string& name : names) {
    decisions.push_back(decide(name, sorted, units.size(), options));
  }
  return decisions;
}

}  // namespace sixpoint::gap
