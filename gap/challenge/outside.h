// Effects outside the catalogue, for blind trials of the diagnosis: real ones, all of them, only
// that the diagnosis has no name for them.
//
// Each kind draws its form (axis, period, place in time, law) from its own random stream, so that a
// hundred trials of one kind are a hundred different recordings. `severity` is the size as a
// multiple of a typical one.
#pragma once

#include <string_view>
#include <vector>

#include "sim/effect.h"

namespace sixpoint::station {

struct OutsideKind {
  sim::EffectKind effect;  // one parameter, `severity`
  // The family of the catalogue whose advice would be right for it; empty: only "unknown" is right.
  std::string_view family;
  bool in_faces = true;  // six faces can show it; else it needs tones or temperatures
  // Drawn only where a trial asks for it by name: a kind that came later changes no earlier trial,
  // and nobody meets it by chance while he works on the diagnosis.
  bool only_by_name = false;
};

const std::vector<OutsideKind>& outside_kinds();

}  // namespace sixpoint::station
