// Mean of a population and spread between its units, from one uncertain number of each unit.
//
//   const std::vector<double> mg_per_c = {0.41, 0.22, 0.55}, uncertainty = {0.02, 0.03, 0.02};
//   const MeanAndSpread all = mean_and_spread(mg_per_c, uncertainty);
//   all.spread;  // between the units: the measurement's own scatter is not in it
//
// A unit's number is normal about the mean with the spread, and what was measured is normal about
// that with the unit's own standard uncertainty. The spread is the one with which the weighted sum
// of squares has its expectation (Paule and Mandel, J. Res. NBS 87, 377 (1982); 0 where it is
// smaller without any), the mean has weights 1 / (spread^2 + uncertainty^2). With units - 1 degrees
// of freedom that is as DerSimonian and Kacker recommend (Contemp. Clin. Trials 28, 105 (2007)).
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace sixpoint::gap {

struct MeanAndSpread {
  double mean = 0;
  std::optional<double> spread;     // none of one unit: it is not known
  double standard_uncertainty = 0;  // of the mean
  std::size_t units = 0;
};

// As many uncertainties as values, at least one. An uncertainty of 0 is taken for a very small one;
// where all are 0 and the values do not differ, the mean's is 0: nothing is known of it.
MeanAndSpread mean_and_spread(std::span<const double> values,
                              std::span<const double> standard_uncertainty);

}  // namespace sixpoint::gap
