// Effects outside the catalogue, for blind trials of the diagnosis: real ones, all of them, only
// that the diagnosis has no name for them.
//
//   for (const OutsideKind& kind : outside_kinds()) {
//     // The family is empty where only `unknown` is the right answer.
//     std::cout << kind.effect.name << ": " << kind.family << '\n';
//   }
//
// Each kind draws its form (axis, period, place in time, law) from its own random stream, so that a
// hundred trials of one kind are a hundred different recordings. `severity` is the size as a
// multiple of a typical one.
#pragma once

#include <string_view>
#include <vector>

#include "sim/effects/effect.h"

namespace sixpoint::gap {

struct OutsideKind {
  sim::EffectKind effect;  // one parameter, `severity`
  // The family of the catalogue whose advice would be right for it; empty: only "unknown" is right.
  std::string_view family;
  bool in_faces = true;  // six faces can show it; else it needs tones or temperatures
  // Drawn only where a trial asks for it by name: a kind that came later changes no earlier trial,
  // and the diagnosis is not tuned to it by chance.
  bool only_by_name = false;
};

const std::vector<OutsideKind>& outside_kinds();

}  // namespace sixpoint::gap
