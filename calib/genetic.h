// The paper's genetic algorithm (Step 3) and its own test of convergence (Step 4).
//
// A member is a set of coefficients. The paper counts nine; positive and negative act only through
// their difference, so a member here has the six that can be told apart. Fitness is the mean
// distance of the still points' magnitude from gravity. The next population is the best member, a
// group from crossover and mutation, and four random members. Sixteen recursions follow one
// another, each seeded with the last population and fed another 10 % of the points: drawn evenly
// over the nine value subsets, plus some at random.
//
// Reproducible: the same points and seed give the same answer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calib/constants.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

struct GeneticOptions {
  std::uint64_t seed = 20160316;
  double gravity_g = 1.0;
  int recursions = 16;     // paper
  int random_members = 4;  // paper
  double subset = 0.10;    // paper
  // The paper is silent on these. Measured on 300 units with six sides tilted by 15 degrees: 64
  // members and 40 generations end in the wrong place 8 times, 120 and 50 never.
  int population = 120;
  int generations = 50;
  // Share of a subset that is drawn at random and not from the value subsets ("a small amount").
  double random_share = 0.2;
  // A tenth of a short file is too few points for six unknowns, a tenth of a long one more than
  // helps: never fewer than this (or all there are), never more than that.
  std::size_t fewest_points = 120;
  std::size_t most_points = 1500;
  // The search range about the file's constants. A sensor's zero lies within 0.5 g, its sensitivity
  // within 10 % of nominal (paper; ADXL362 datasheet), and the filter mismatch adds to that.
  double zero_range_g = 0.5;
  double gain_low = 0.72;
  double gain_high = 1.38;
  // Step 4. The best fitness of the last half of the recursions may spread by this much and tend in
  // one direction by no more; its level may be what real units leave (4 mg) doubled.
  double most_spread_mg = 1.5;
  double most_level_mg = 8.0;
  // The last half's best members may lie this far (RMS over the sphere) from their mean.
  double most_wander_mg = 5.0;
};

struct GeneticResult {
  Calibration calibration;           // mean of the best members of the last half of the recursions
  std::vector<double> fitness_mg;    // best member of each recursion on its own subset
  double level_mg = 0;               // mean over the last half
  double spread_mg = 0;              // standard deviation over the last half
  double trend_mg = 0;               // change over the last half by linear regression
  double wander_mg = 0;              // RMS distance of those best members from their mean
  bool settled = false;              // Step 4 of the paper
  std::vector<std::string> reasons;  // why it has not settled
  std::size_t points_per_recursion = 0;
  int evaluations = 0;  // members evaluated
};

// bad_data without points or with points that are not finite; usage for options that make no sense.
Result<GeneticResult> genetic(std::span<const StillBlock> blocks, const Calibration& file_constants,
                              const GeneticOptions& options = {});

}  // namespace sixpoint::calib
