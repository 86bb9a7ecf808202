// The paper's genetic algorithm (Step 3) and its own test of convergence (Step 4).
//
//   SIXPOINT_ASSIGN(const GeneticResult found, genetic(blocks, file_constants));
//   if (found.settled) {
//     const Calibration& constants = found.calibration;
//   }
//
// A member is a set of coefficients. The paper counts nine; positive and negative act only through
// their difference, so a member here has six. Fitness is the mean
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
  static constexpr int recursions = 16;     // paper
  static constexpr int random_members = 4;  // paper
  static constexpr double subset = 0.10;    // paper
  // The paper is silent on these. Measured on 300 units with six sides tilted by 15 degrees: 64
  // members and 40 generations end in the wrong place 8 times, 120 and 50 never.
  static constexpr int population = 120;
  static constexpr int generations = 50;
  // Share of a subset that is drawn at random and not from the value subsets ("a small amount").
  static constexpr double random_share = 0.2;
  // A tenth of a short file is too few points for six unknowns, a tenth of a long one more than
  // helps: never fewer than this (or all there are), never more than that.
  static constexpr std::size_t fewest_points = 120;
  static constexpr std::size_t most_points = 1500;
  // Step 4. The best fitness of the last half of the recursions may spread by this much and tend in
  // one direction by no more; its level may be what real units leave (4 mg) doubled.
  static constexpr double most_spread_mg = 1.5;
  static constexpr double most_level_mg = 8.0;
  // The last half's best members may lie this far (RMS over the sphere) from their mean.
  static constexpr double most_scatter_mg = 5.0;
};

struct GeneticResult {
  Calibration calibration;           // mean of the best members of the last half of the recursions
  std::vector<double> fitness_mg;    // best member of each recursion on its own subset
  double level_mg = 0;               // mean over the last half
  double spread_mg = 0;              // standard deviation over the last half
  double trend_mg = 0;               // change over the last half by linear regression
  double scatter_mg = 0;             // RMS distance of those best members from their mean
  bool settled = false;              // Step 4 of the paper
  std::vector<std::string> reasons;  // why it has not settled
};

// bad_data without points or with points that are not finite.
Result<GeneticResult> genetic(std::span<const StillBlock> blocks, const Calibration& file_constants,
                              const GeneticOptions& options = {});

}  // namespace sixpoint::calib
