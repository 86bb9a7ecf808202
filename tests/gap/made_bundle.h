// Bundles made in memory, by a few lines of their own and none of sim/: what the diagnosis finds in
// them is known in closed form.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "gap/recording/bundle.h"

namespace sixpoint::tests {

struct MadeUnit {
  Eigen::Vector3d gain = {1.01, 0.985, 1.02};
  Eigen::Vector3d offset_g = {0.02, -0.03, 0.01};
  Eigen::Vector3d noise_g = {0.0039, 0.0039, 0.0055};
  double seating_deg = 0.01;
  unsigned seed = 1;
  int rounds = 1;                // how often the eighteen dwells are made
  int yaws = 4;                  // poses differ by quarter turns about the vertical; 1: they do not
  std::size_t long_samples = 0;  // of one more record in the last pose, if not 0
};

// Specific force in the sensor's frame for a segment, at `t` seconds from its start.
using MadeForce = std::function<Eigen::Vector3d(const gap::Segment&, double t)>;

inline Eigen::Matrix3d up_along(int axis, int sign, int yaw) {
  const Eigen::Vector3d up = sign * Eigen::Vector3d::Unit(axis);
  const Eigen::Vector3d side = Eigen::Vector3d::Unit((axis + 1) % 3);
  Eigen::Matrix3d r;
  r.col(2) = up;
  r.col(0) = side;
  r.col(1) = up.cross(side);
  return r * Eigen::AngleAxisd(yaw * M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// Six faces, the same reversed, and once more out of order: the production protocol's shape.
inline gap::Bundle made_production(const MadeUnit& unit, const MadeForce& force = {}) {
  gap::Bundle bundle;
  bundle.path = "made";
  bundle.header.serial = bundle.protocol_serial = "MOS2E00000001";
  const std::array<int, 18> round = {0, 1, 2, 3, 4, 5, 5, 4, 3, 2, 1, 0, 3, 0, 5, 2, 4, 1};
  std::vector<int> order;
  for (int k = 0; k < unit.rounds; ++k) {
    order.insert(order.end(), round.begin(), round.end());
  }
  const std::size_t dwells = order.size();
  if (unit.long_samples > 0) {
    order.push_back(order.back());
  }
  std::mt19937_64 random(unit.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> stamp(-0.002, 0.002);
  double host_s = 30;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < order.size(); ++i) {
    gap::Segment segment;
    segment.name = i >= dwells   ? "still"
                   : i % 18 < 6  ? "faces"
                   : i % 18 < 12 ? "faces_reversed"
                                 : "reseat";
    segment.first_sample = bundle.samples.size();
    segment.samples = i < dwells ? 1000 : unit.long_samples;
    segment.host_start_s = host_s;
    segment.rotation = up_along(order[i] / 2, order[i] % 2 == 0 ? 1 : -1, order[i] % unit.yaws);
    segment.temperature_start_c = segment.temperature_end_c = 23;
    segment.placement = static_cast<int>(i);
    segment.pose = order[i];
    const Eigen::Vector3d pose = segment.rotation.col(2);
    segment.approach_g =
        i == 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(pose - before);
    before = pose;
    Eigen::Vector3d seat;
    for (Eigen::Index a = 0; a < 3; ++a) {
      seat[a] = normal(random) * unit.seating_deg * M_PI / 180;
    }
    for (std::size_t n = 0; n < segment.samples; ++n) {
      const double t = static_cast<double>(n) / 100;
      Eigen::Vector3d f = force ? force(segment, t) : pose;
      f += seat.cross(f);
      gt3x::Counts counts;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto e = static_cast<Eigen::Index>(a);
        const double g = f[e] * unit.gain[e] + unit.offset_g[e] + normal(random) * unit.noise_g[e];
        counts[a] = static_cast<std::int16_t>(std::clamp(std::lround(256 * g), -2048L, 2047L));
      }
      bundle.samples.push_back(counts);
      if (n % 100 == 0) {
        bundle.host_clock.sample_index.push_back(segment.first_sample + n);
        bundle.host_clock.host_time_s.push_back(host_s + t + stamp(random));
      }
    }
    bundle.segments.push_back(segment);
    host_s += static_cast<double>(segment.samples) / 100 + 6;
  }
  for (double t = 0; t < host_s; t += 1) {
    bundle.temperature.host_time_s.push_back(t);
    bundle.temperature.temperature_c.push_back(23);
  }
  return bundle;
}

}  // namespace sixpoint::tests
