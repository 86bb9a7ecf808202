// Do two sets of constants of one unit say the same?
//
//   const Agreement between = agreement(constants, uncertainty, others, their_uncertainty);
//   if (!between.agree()) {
//     const std::string text = between.brief();  // "they differ by 84.1 mg on y at 0 g; ..."
//   }
//
// Both are applied to one raw count of the sensor, on each axis at -1 g, 0 g and +1 g. They agree
// where everywhere
//
//     difference <= 3 sqrt(u1^2 + u2^2) + allowance
//
// with u the standard uncertainty of the value in g: zero and sensitivity together.
#pragma once

#include <string>

#include "calib/constants.h"

namespace sixpoint::calib {

// Two sets are measured at two temperatures: a zero of this sensor moves by up to 0.5 mg/C
// (datasheet), and a worn unit is some 20 C warmer than one that lies in a cold room.
inline constexpr double kTemperatureAllowance_mg = 10;

// Where the two differ most, in units of what is allowed there.
struct Agreement {
  double difference_mg = 0;
  double allowed_mg = 0;
  std::size_t axis = 0;
  double at_g = 0;  // by the first set

  bool agree() const { return difference_mg <= allowed_mg; }
  std::string brief() const;
};

// An uncertainty that is not stated (0, or no finite number) counts as 0.
Agreement agreement(const Calibration& first, const ConstantsUncertainty& of_first,
                    const Calibration& second, const ConstantsUncertainty& of_second,
                    double allowance_mg = kTemperatureAllowance_mg);

// Standard uncertainty of a value of `at_g` on an axis; 0 where none is stated.
double standard_uncertainty_mg(const ConstantsUncertainty& uncertainty, std::size_t axis,
                               double at_g);
// The largest of the three axes at 1 g: one number for people. 0 where none is stated.
double largest_uncertainty_mg(const ConstantsUncertainty& uncertainty);

}  // namespace sixpoint::calib
