// The straight line through a block of readings, axis by axis: what decides whether it lay still.
//
//   const BlockLine line = line_through(readings);
//   const bool still = line.slope.cwiseAbs().maxCoeff() < 5e-4;
//
// calib/still_blocks.h has the paper's finder. It needs the recording's integer counts and begins a
// block anywhere; this one takes readings of any unit, block by block.
#pragma once

#include <Eigen/Core>
#include <span>

namespace sixpoint::gap {

struct BlockLine {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();   // per reading
  Eigen::Vector3d square = Eigen::Vector3d::Zero();  // sum of squares about the line
};

// At least two readings, equally far apart in time.
inline BlockLine line_through(std::span<const Eigen::Vector3d> readings) {
  BlockLine line;
  const auto n = static_cast<double>(readings.size());
  for (const Eigen::Vector3d& reading : readings) {
    line.mean += reading / n;
  }
  const auto centred = [n](std::size_t i) { return static_cast<double>(i) - (n - 1) / 2; };
  double square_index = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    line.slope += centred(i) * (readings[i] - line.mean);
    square_index += centred(i) * centred(i);
  }
  line.slope /= square_index;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    line.square += (readings[i] - line.mean - centred(i) * line.slope).cwiseAbs2();
  }
  return line;
}

}  // namespace sixpoint::gap
