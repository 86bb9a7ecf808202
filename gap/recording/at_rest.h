// What lies still: whole stretches of a pose in mg, and pieces of one length.
//
//   for (const Stretch& stretch : stretches(bundle, clean)) {
//     const std::vector<double>& x_mg = stretch.x[0];  // about its mean
//   }
//
// A dwell begins where its ringing is over (Segment::quiet_start).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

// A stretch at rest in one pose, mean removed, masked samples zero, in mg.
struct Stretch {
  std::size_t samples = 0;
  double start_s = 0;  // by the host's clock
  Eigen::Matrix3d rotation;
  int pose = 0;
  std::array<std::vector<double>, 3> x;
};
// Of four seconds and more, nine tenths of them unmasked.
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
