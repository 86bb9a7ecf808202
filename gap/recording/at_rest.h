// What lies still: whole stretches of a pose in mg, and pieces of one length.
//
//   for (const Stretch& stretch : stretches(bundle, clean)) {
//     const std::vector<double>& x_mg = stretch.x[0];  // about its trend
//   }
//
// A dwell begins where its ringing is over (Segment::quiet_start).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

// Of the first `count` samples of a segment: their places since its start by the unit's clock. None
// of masked samples, and of those in a second in which the clock slips. A clock that would repeat
// or lose more than there is says nothing: then all have the places at which they are stored.
using Places = std::vector<std::optional<std::size_t>>;
Places places_by_clock(const CleanSamples& clean, const Segment& segment, std::size_t count);

// A stretch at rest in one pose, in mg, the line through its samples taken off. Each sample stands
// at its place; places without one are zero.
struct Stretch {
  std::size_t samples = 0;  // places
  std::size_t known = 0;    // of them that have a sample
  double start_s = 0;       // by the host's clock
  Eigen::Matrix3d rotation;
  int pose = 0;
  std::array<std::vector<double>, 3> x;
  std::vector<bool> is_known;
};
// Of four seconds and more, nine tenths of them unmasked, and half of them without slips.
std::vector<Stretch> stretches(const Bundle& bundle, const CleanSamples& clean);

// Samples [first, first + samples) of the recording, of one segment at rest.
struct RestPiece {
  std::size_t segment = 0;
  std::size_t first = 0;
  std::size_t samples = 0;
};
// The pieces of one segment, one behind the other, none if it is not at rest; the last one may be
// shorter. `every`: takes only each so many-th.
std::vector<RestPiece> rest_pieces(const Bundle& bundle, std::size_t segment, std::size_t length,
                                   std::size_t every = 1);

}  // namespace sixpoint::gap
