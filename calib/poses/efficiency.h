// How good a set of still directions is for the fit, beside the best that there is.
//
//   const DesignEfficiency six = efficiency_of(fit, 6);
//   six.d;  // 1 for the six sides
//
// A still reading of direction u (a unit vector) differs from gravity by r(u)' p, to first order in
// the parameters' errors p:
//
//     six    r = (ux^2, uy^2, uz^2, ux, uy, uz)          three sensitivities, three zeros
//     nine   r = (..., uy uz, ux uz, ux uy)              and three cross-axis terms
//
// With M = sum w r r' / sum w, the weights those of the fit, the two measures are (Kiefer and
// Wolfowitz 1960; for accelerometers Ye and Su 2015)
//
//     D  = (det M / det of the best M)^(1/n)   the volume in which the parameters lie
//     G  = n / max over all u of r' M^-1 r     the direction that is predicted worst
//
// 1 is the best of all sets. 1 / efficiency tells how many times longer a recording has to be for
// the same uncertainty. 0: these directions do not determine the parameters.
//
// | directions, equally long       | six: D, G    | nine: D, G     |
// |--------------------------------|--------------|----------------|
// | six sides                      | 1, 1         | 0, 0           |
// | six sides and eight corners    | 0.754, 0.692 | 0.999, 0.973   |
// | twelve poses of an icosahedron | 0.737, 0.667 | 1, 1           |
//
// Pure functions.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "calib/block_fit.h"
#include "calib/solve.h"

namespace sixpoint::calib {

struct DesignEfficiency {
  double d = 0;
  double g = 0;
};

// `parameters`: 6 or 9.
DesignEfficiency efficiency_of(const BlockFit& fit, int parameters);

// The answer of `sixpoint solve`, of `capture` and of the Python package: to_json(report) and,
// where there is a fit, "efficiency": how many parameters were fitted, and both efficiencies.
nlohmann::ordered_json solve_json(const SolveReport& report);

}  // namespace sixpoint::calib
