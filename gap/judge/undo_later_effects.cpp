#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

struct Later {
  std::string_view effect;  // acts later
  std::string_view by;      // its parameter
};
constexpr Later kMode = {"filter_mismatch", "gain"};
constexpr Later kClock = {"clock_error", "ppm"};

struct Changed {
  std::string_view effect;
  std::string_view parameter;
  Later later;
};
constexpr std::array kChanged = {Changed{"settling", "amplitude", kMode},
                                 Changed{"floor_vibration", "vector_mg", kMode},
                                 Changed{"floor_vibration", "frequency_hz", kClock},
                                 Changed{"electrical_line", "frequency_hz", kClock}};

// By what the parameter is to be multiplied, and that factor's standard uncertainty.
struct Multiplier {
  double value = 1;
  double sd = 0;
};

Multiplier multiplier_of(const Later& later, const Findings& found) {
  const auto effect = std::ranges::find(found.effects, later.effect, &EffectFinding::name);
  if (effect == found.effects.end()) {
    return {};
  }
  const auto by = std::ranges::find(effect->parameters, later.by, &NamedValue::name);
  if (by == effect->parameters.end()) {
    return {};
  }
  if (later.effect == kClock.effect) {
    return {1 + 1e-6 * by->value[0], 1e-6 * by->sd[0]};
  }
  return {1 / by->value[0], by->sd[0] / (by->value[0] * by->value[0])};
}

void multiply(const Multiplier& by, std::string_view name, std::vector<NamedValue>& parameters) {
  for (NamedValue& parameter : parameters) {
    for (std::size_t i = 0; parameter.name == name && i < parameter.value.size(); ++i) {
      parameter.sd[i] = std::hypot(by.value * parameter.sd[i], by.sd * parameter.value[i]);
      parameter.value[i] *= by.value;
    }
  }
}

}  // namespace

void undo_later_effects(Findings& found) {
  for (const Changed& changed : kChanged) {
    const Multiplier by = multiplier_of(changed.later, found);
    for (auto* list : {&found.effects, &found.candidates}) {
      for (EffectFinding& effect : *list) {
        if (effect.name != changed.effect) {
          continue;
        }
        multiply(by, changed.parameter, effect.parameters);
        for (std::vector<NamedValue>& line : effect.further_lines) {
          multiply(by, changed.parameter, line);
        }
      }
    }
  }
}

}  // namespace sixpoint::gap
