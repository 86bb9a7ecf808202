// Kinds of scatter between dwells: those of the catalogue, and those that stand for unknown causes.
//
//   for (const double size : sizes_of(Scatter::random_walk)) {            // mg/sqrt(s)
//     const double covariance_mg2 =
//         size * size * scatter_kernel(Scatter::random_walk, blocks[0], blocks[1], start_s);
//   }
#pragma once

#include <string_view>
#include <vector>

#include "gap/explain/forward.h"

namespace sixpoint::gap {

enum class Scatter {
  nominal,
  seating,
  random_walk,
  flicker,
  by_pose,  // from here on the catalogue does not have them
  by_placement,
  by_session,  // a session: a run of segments of one name
  seat_walks,  // each seat begins where the one before was
  by_temperature,
  by_time,
  by_time_fast,
  step  // the zero moves once, between two placements
};
std::string_view to_string(Scatter scatter);
bool in_catalogue(Scatter scatter);

// Scatter of the nominal simulator's seating: new at every placement.
inline constexpr double kNominalSeating_deg = 0.01;

// Sizes to be tried, log-uniform: deg for seating, deg per placement for seat_walks, mg/sqrt(s) for
// random_walk, else mg.
std::vector<double> sizes_of(Scatter scatter);
// Log prior of one of these sizes.
double scatter_log_prior(Scatter scatter);

// Variance of one feature that noise and nominal seating leave, mg^2.
double nominal_variance_mg2(const Block& block, Eigen::Index feature);

bool same_pose(const Block& a, const Block& b);

// Covariance of two blocks' means on one axis for size one; 0 for nominal, seating and seat_walks,
// which are rotations (seating_lever). `start_s`: host time at which the first block begins.
double scatter_kernel(Scatter scatter, const Block& a, const Block& b, double start_s);

}  // namespace sixpoint::gap
