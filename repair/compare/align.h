// The clock of one unit against that of another, from recordings of units that moved together.
//
//   PairComparison result;
//   const Line lag_s = align(a, b, {}, result);
//   const double in_b_s = time_s + lag_s.at(time_s);  // the moment time_s of A, by B's clock
#pragma once

#include <cstddef>
#include <vector>

#include "repair/compare/compare.h"

namespace sixpoint::repair {

// Lag over time: seconds, of A's Unix time.
struct Line {
  double lag_s = 0;  // at `middle_s`
  double slope = 0;
  double middle_s = 0;
  double at(double time_s) const { return lag_s + slope * (time_s - middle_s); }
};

// What chance gives as well is no alignment. The lively parts of a recording (minutes; of less than
// twenty minutes, twentieths of ten seconds and more) are correlated each by itself, and a lag is
// believed only where enough of them agree on it. Motion that comes and goes alike is a witness of
// its own, which makes chance a hundred times less likely at most.
struct Agreement {
  std::size_t agreeing = 0;     // parts that lie on the line
  std::vector<double> chances;  // per part that fits somewhere: that it lies there by chance
  double lines_tried = 1;
  double swelling = 1;  // that the motions swell so much alike by chance; counts down to 0.01

  // That so many or more agree on any line tried, and the motions swell so, by chance alone.
  double by_chance() const;
};

// Whether a line is an alignment. limit_s is max_lag_s and one sample of the slower unit.
//
//   parts that agree | by chance           | lag            | answer
//   -----------------|---------------------|----------------|------------
//   none, 1 or 2     | any                 | any            | not aligned
//   3 or more        | 1 in 10,000 or more | any            | not aligned
//   3 or more        | less                | beyond limit_s | not aligned
//   3 or more        | less                | up to limit_s  | aligned
bool is_alignment(const Agreement& agreement, double lag_s, double limit_s);

// Fills in how well it is known: aligned, minutes_used, lag_uncertainty_s, remarks. Where it is
// not aligned, lag and slope are 0.
Line align(const Trace& a, const Trace& b, const CompareOptions& options, PairComparison& result);

}  // namespace sixpoint::repair
