// Quantiles and tails of the distributions that statistics need. NaN for arguments that have none.
#pragma once

namespace sixpoint::station {

double normal_quantile(double probability);
double chi_square_quantile(double probability, double degrees_of_freedom);
// P(F > f).
double f_upper_tail(double f, double degrees_of_freedom_1, double degrees_of_freedom_2);

}  // namespace sixpoint::station
