// Does the recording follow the protocol at all? No effect of the catalogue moves the mean of a
// dwell by 50 mg while it lasts, or leaves a dwell 200 mg off any gain and offset of its axis: then
// the list of poses or of sample numbers belongs to another recording.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {

namespace {

constexpr double kMoves_g = 0.05;
constexpr double kElsewhere_g = 0.2;
constexpr double kAlarmUnit_g = 0.005;   // convention: one standard deviation of the alarm
constexpr double kRing_s = 2;            // left out after a move
constexpr double kLeastHalf_s = 1;       // unmasked, in each half of a dwell
constexpr std::size_t kLeastDwells = 6;  // for a gain and an offset per axis
constexpr std::size_t kFewMoving = 4;    // one dwell in four may move

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
    const double least = kLeastHalf_s * bundle.rate_hz;
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

// The dwell that lies furthest from gain * pose + offset on any axis, and by how much.
struct Worst {
  std::size_t segment = 0;
  double off_g = 0;
};

Worst worst_of(const std::vector<Dwell>& dwells) {
  constexpr double kRegular = 1e-9;
  Worst worst;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Identity() * kRegular;
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Dwell& dwell : dwells) {
      const Eigen::Vector2d row(dwell.pose[axis], 1);
      normal += row * row.transpose();
      right += row * dwell.mean_g[axis];
    }
    const Eigen::Vector2d fit = normal.inverse() * right;
    for (const Dwell& dwell : dwells) {
      const double off_g = std::abs(dwell.mean_g[axis] - fit[0] * dwell.pose[axis] - fit[1]);
      if (off_g > worst.off_g) {
        worst = {dwell.segment, off_g};
      }
    }
  }
  return worst;
}

}  // namespace

PoseCheck judge_poses(const Bundle& bundle, const CleanSamples& clean) {
  PoseCheck check;
  const std::vector<Dwell> dwells = dwells_of(bundle, clean);
  const auto moving = static_cast<std::size_t>(
      std::count_if(dwells.begin(), dwells.end(), [](const Dwell& dwell) { return dwell.moves; }));
  check.moving = kFewMoving * moving > dwells.size();
  if (check.moving || dwells.size() < kLeastDwells) {
    return check;
  }
  const Worst worst = worst_of(dwells);
  if (worst.off_g > kElsewhere_g) {
    check.wrong = true;
    check.found.alarm(
        worst.off_g / kAlarmUnit_g,
        fmt::format("pose: segment {} ({}) does not lie as the protocol says, by {:.2f} g",
                    worst.segment, bundle.segments[worst.segment].name, worst.off_g));
  }
  return check;
}

}  // namespace sixpoint::gap
