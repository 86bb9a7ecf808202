// The clock of one unit against that of another, from recordings of units that moved together.
//
//   PairComparison result;
//   const Line lag_s = align(a, b, {}, result);
//   const double in_b_s = time_s + lag_s.at(time_s);  // the moment time_s of A, by B's clock
#pragma once

#include "repair/compare/compare.h"

namespace sixpoint::repair {

// Lag over time: seconds, of A's Unix time.
struct Line {
  double lag_s = 0;  // at `middle_s`
  double slope = 0;
  double middle_s = 0;
  double at(double time_s) const { return lag_s + slope * (time_s - middle_s); }
};

// Fills in how well it is known: aligned, minutes_used, lag_uncertainty_s, remarks. Where nothing
// fits, lag and slope are 0.
Line align(const Trace& a, const Trace& b, const CompareOptions& options, PairComparison& result);

}  // namespace sixpoint::repair
