// The six constants that leave the smallest error when they are applied, and the map with
// cross-axis terms beside them.
//
//   const BestSix six = best_six(fit, 1.0);  // 1 g
//   const Calibration& constants = six.calibration;
//   six.elsewhere_mg;  // how wrong they may be in directions that the unit hardly took
//
// The sensitivities and zeros of a sensor with cross-axis terms are right in every direction when
// the terms are applied too. Without the terms they are not the best six: over a day of one person
// (a GT9X, terms of -1.9 0.0 0.8 %) they leave 11.3 mg at rest in directions that the fit had not
// seen, and six constants fitted to the time at rest 7.3 mg. So several sixes are tried on
// directions that are left out of their fits:
//
// | cross-axis terms | unseen directions, over the time at rest | six           |
// |------------------|------------------------------------------|---------------|
// | not admitted     | -                                        | of_fit        |
// | admitted         | fewer than 30 can be predicted           | of_sensor     |
// | admitted         | no other is better by a tenth            | of_sensor     |
// | admitted         | every direction equal is best            | of_directions |
// | admitted         | every minute at rest equal is best       | of_time       |
//
// Terms are admitted where BlockFit::richer is there.
// Fewer than 30 directions are those of a calibration file: what leads the hand from side to side
// says nothing about how the unit is worn. A six that leaves more than
// VerificationLimits::applied_mg over all directions is not tried. Where the unit has no cross-axis
// terms none are admitted, and the six are the true six. The six best for the time worn may be
// wrong in directions that the unit hardly took; `elsewhere_mg` says by how much. Magnitudes are in
// mg. Pure functions.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "calib/block_fit.h"
#include "calib/constants.h"

namespace sixpoint::calib {

enum class SixFrom {
  of_fit,         // the only fit there is
  of_sensor,      // the sensor's own: those that belong to the cross-axis terms
  of_directions,  // fitted without the terms, every direction equal
  of_time,        // fitted without the terms, every minute at rest equal
};
std::string_view to_string(SixFrom from);

struct BestSix {
  Calibration calibration;
  SixFrom from = SixFrom::of_fit;
  // Root mean square error in directions that the fits had not seen, over the time at rest.
  struct Unseen {
    double of_sensor = 0;
    double of_directions = 0;
    double of_time = 0;
    double matrix = 0;  // the sensor's own six with the cross-axis terms
    int directions = 0;
  };
  std::optional<Unseen> unseen_mg;  // absent where no cross-axis terms were admitted
  double unseen_chosen_mg() const;
  // The largest difference from the map with cross-axis terms over all directions.
  double elsewhere_mg = 0;
  std::vector<double> cell_sigma_mg;  // the weights of the cells that `calibration` was fitted with
};

// `fit` as fit_blocks() gave it.
BestSix best_six(const BlockFit& fit, double gravity_g);

// The map of the richer model with its uncertainty, that of gravity included; absent where no
// cross-axis terms were admitted. `verified` is false: only a verdict can set it.
std::optional<CrossAxisMap> cross_axis_map(const BlockFit& fit, const BestSix& six,
                                           double gravity_relative_sd);

// Standard uncertainty, in mg, of the magnitude that a fit with cross-axis terms gives in the
// direction where it is largest.
double worst_direction_with_terms_mg(const LeastSquaresFit& fit);

}  // namespace sixpoint::calib
