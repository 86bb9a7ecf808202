// Does the recording follow the protocol at all? Nothing of the catalogue moves the mean of a dwell
// by 50 mg while it lasts, or holds a dwell 200 mg off every gain and offset that an axis may have:
// what does is a list of poses or of sample numbers that is not of this recording.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

namespace {

constexpr double kMoves_g = 0.05;
constexpr double kElsewhere_g = 0.2;
constexpr double kRing_s = 2;
constexpr std::size_t kLeastDwells = 6;

struct Dwell {
  std::size_t segment = 0;
  Eigen::Vector3d pose = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
  bool moves = false;
};

std::vector<Dwell> dwells_of(const Bundle& bundle, const CleanSamples& clean) {
  std::vector<Dwell> dwells;
  for (std::size_t k = 0; k < bundle.segments.size(); ++k) {
    const Segment& segment = bundle.segments[k];
    if (segment.kind != Segment::Kind::still && segment.kind != Segment::Kind::soak) {
      continue;
    }
    const std::size_t ring =
        std::min(static_cast<std::size_t>(kRing_s * bundle.rate_hz), segment.samples / 2);
    const std::size_t middle = segment.first_sample + (ring + segment.samples) / 2;
    std::array<Eigen::Vector3d, 2> sum = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    std::array<double, 2> n{};
    for (std::size_t i = segment.first_sample + ring; i < segment.first_sample + segment.samples;
         ++i) {
      if (clean.flags[i] == kSampleGood) {
        const gt3x::Counts& counts = clean.samples[i];
        const std::size_t half = i < middle ? 0 : 1;
        sum.at(half) += Eigen::Vector3d(counts[0], counts[1], counts[2]);
        n.at(half) += 1;
      }
    }
    const double least = bundle.rate_hz;  // a second in each half
    if (n[0] < least || n[1] < least) {
      continue;
    }
    const double lsb_per_g = bundle.accel_scale_lsb_per_g;
    const Eigen::Vector3d between = (sum[1] / n[1] - sum[0] / n[0]) / lsb_per_g;
    dwells.push_back({k, bundle.gravity_in_sensor(segment),
                      (sum[0] + sum[1]) / ((n[0] + n[1]) * lsb_per_g),
                      between.cwiseAbs().maxCoeff() > kMoves_g});
  }
  return dwells;
}

}  // namespace

bool Diagnoser::judge_poses() {
  const std::vector<Dwell> dwells = dwells_of(bundle_, clean_);
  const auto moving = static_cast<std::size_t>(
      std::count_if(dwells.begin(), dwells.end(), [](const Dwell& dwell) { return dwell.moves; }));
  if (4 * moving > dwells.size()) {
    return false;
  }
  if (dwells.size() < kLeastDwells) {
    return true;
  }
  double worst_g = 0;
  std::size_t worst = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Identity() * 1e-9;
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Dwell& dwell : dwells) {
      const Eigen::Vector2d row(dwell.pose[axis], 1);
      normal += row * row.transpose();
      right += row * dwell.mean_g[axis];
    }
    const Eigen::Vector2d fit = normal.inverse() * right;
    for (const Dwell& dwell : dwells) {
      const double off_g = std::abs(dwell.mean_g[axis] - fit[0] * dwell.pose[axis] - fit[1]);
      if (off_g > worst_g) {
        worst_g = off_g;
        worst = dwell.segment;
      }
    }
  }
  if (worst_g > kElsewhere_g) {
    poses_wrong_ = true;
    alarm(worst_g / 0.005,
          fmt::format("pose: segment {} ({}) does not lie as the protocol says, by "
                      "{:.2f} g",
                      worst, bundle_.segments[worst].name, worst_g));
  }
  return true;
}

}  // namespace sixpoint::gap
