// Quantiles and tail probabilities, by Boost.Math (used in distributions.cpp alone).
//
//   normal_quantile(0.975);            // 1.96
//   chi_square_quantile(0.975, 19);    // 32.85
//   f_upper_tail(3.885, 2, 12);        // 0.05
//
// Pure functions. NaN for arguments outside the distribution's domain.
#pragma once

namespace sixpoint::station {

double normal_quantile(double probability);
double chi_square_quantile(double probability, double degrees_of_freedom);
// P(F > f).
double f_upper_tail(double f, double degrees_of_freedom_1, double degrees_of_freedom_2);

}  // namespace sixpoint::station
