// Kinds of scatter between dwells: those of the catalogue, and those that stand for what it has
// not.
#pragma once

#include <string_view>
#include <vector>

#include "gap/forward.h"

namespace sixpoint::gap {

enum class Scatter {
  nominal,
  seating,
  random_walk,
  flicker,
  by_pose,       // from here on what the catalogue has not
  by_placement,  // and with the amplitude of tones
  by_session,    // runs of segments of one name
  by_temperature,
  by_time,
  by_time_fast,
  step  // the zero moved once, between two placements
};
std::string_view to_string(Scatter scatter);
bool in_catalogue(Scatter scatter);

inline constexpr double kNominalSeating_deg = 0.01;

// Sizes to be tried, log-uniform: deg for seating, mg/sqrt(s) for random_walk, else mg.
std::vector<double> sizes_of(Scatter scatter);

bool same_pose(const Block& a, const Block& b);

// Covariance of two blocks' means on one axis for scatter that is not of the seat, of size one.
// `start_s`: host time at which the first block begins.
double scatter_kernel(Scatter scatter, const Block& a, const Block& b, double start_s);

}  // namespace sixpoint::gap
