// Two recordings of units that were moved together: how far apart are they? (paper, Results and
// Figures 4-6)
//
//   SIXPOINT_ASSIGN(const Trace a, Trace::load(files, "a.gt3x"));
//   SIXPOINT_ASSIGN(const Trace b, Trace::load(files, "b.gt3x"));
//   SIXPOINT_ASSIGN(const PairComparison pair, compare(a, b));
//   pair.envelope.p95_mg;  // how far apart they are
//
// Two units on one shaker feel the same acceleration, but their clocks differ, their axes may point
// elsewhere and their samples fall at other moments. So:
//
//  - Everything is done on the vector magnitude, which does not care how a unit lies.
//  - Alignment in time: how the motion swells and fades (standard deviation within a second) is
//    correlated first, to some tenths of a second; then, at up to 32 lags that this gives, up to 60
//    lively minutes (of less than twenty minutes, twentieths) are correlated to a fraction of a
//    sample, each by itself; a straight line through their lags gives lag and drift.
//    A minute of steady shaking fits at every period; therefore every good peak of every minute is
//    a candidate, and the line wins that most of them agree on near the first lag. It is believed
//    where chance does not let so many agree (align.h has the rule as a table). Of the lines that
//    are believed the one wins at which the whole recordings correlate best.
//  - Envelopes: per second the largest and the smallest magnitude, of each unit's own samples.
//    Their differences are the errors of the paper's histograms; they do not depend on where within
//    a vibration the samples fall.
//  - RMS of the difference of the magnitudes, B interpolated (cubic) at the times of A's samples.
//    At high frequencies it also holds what interpolation and the remaining lag cost.
//
// Of 40 simulated pairs of units worn at once (10 and 20 minutes, lags of -60 to 60 s, clocks up to
// 100 ppm off) 40 are aligned, each within its stated uncertainty; of 40 pairs of other motions
// none (Compare.RelatedPairsAreAlignedAndUnrelatedOnesAreNot).
//
// Comparisons are of hours: a recording may hold up to kMaxTraceSamples samples, which are kept in
// memory (4 bytes each).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "repair/compare/trace.h"

namespace sixpoint::repair {

struct CompareOptions {
  // Clocks are set by the same computer when units are prepared; more than this is no common
  // recording. No lag beyond it is found, but for one sample.
  double max_lag_s = 120;
  // A minute with less motion than this says nothing about time (twice the noise of two units).
  double min_motion_mg = 20;
  std::size_t histogram_bins = 50;
};

struct Envelopes {
  double mean_mg = 0;  // of B - A
  double sd_mg = 0;
  double p95_mg = 0;  // 95th percentile of |B - A|
  std::uint64_t errors = 0;
};

struct Histogram {
  // Edges in ascending order, one more than counts. The outermost bins also hold what lies beyond.
  std::vector<double> edges_mg;
  std::vector<std::uint64_t> counts;
};

struct PairComparison {
  std::string a;
  std::string b;
  // The same moment stands at time t in A and at t + lag_s in B, near lag_at_s (Unix time in A, the
  // middle of the minutes used); away from there the lag changes by drift_ppm.
  double lag_s = 0;
  double lag_at_s = 0;
  gt3x::Clock clock;  // of A
  double drift_ppm = 0;
  // The error of lag_s is smaller in 99 of 100 cases; where the motion is periodic, the distance of
  // the farthest lag that fits nearly as well (a remark says so). 0 only where it is not aligned.
  double lag_uncertainty_s = 0;
  // By the table in align.h. false: nothing moved, or what fitted fits by chance; then lag_s is 0.
  bool aligned = false;
  std::size_t minutes_used = 0;  // rounded, and at least 1 where it is aligned
  double overlap_s = 0;          // seconds in which both have samples
  double rms_mg = 0;
  Envelopes envelope;
  Histogram histogram;
  std::vector<std::string> remarks;

  double shown_lag_s() const;  // with the four digits that people see, and never "-0.0000"
  std::string brief() const;
  bool usable() const { return aligned && envelope.errors > 0; }
  nlohmann::ordered_json to_json() const;  // the keys of the contract, and the others above
};

// bad_data where the two have no second in common.
Result<PairComparison> compare(const Trace& a, const Trace& b, const CompareOptions& options = {});

// A page that needs nothing else: per pair the magnitudes over the whole time (as envelopes), ten
// lively seconds sample by sample, and the histogram of errors; after the paper's Figures 4-6.
std::string compare_html(const std::vector<Trace>& traces,
                         const std::vector<PairComparison>& pairs);

}  // namespace sixpoint::repair
