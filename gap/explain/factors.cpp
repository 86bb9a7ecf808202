#include "gap/explain/factors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace sixpoint::gap {
namespace {

// Conventions: how many cosines, the least span of temperature that counts, two time constants with
// which a lagging temperature follows.
constexpr int kCosinesOfTime = 4;
constexpr int kCosinesOfTemperature = 3;
constexpr double kLeastSpan_c = 3;
constexpr std::array<double, 2> kLag_s = {300, 1500};
constexpr double kLagUnit_c = 5;
constexpr std::size_t kMostSessions = 24;  // a protocol with more has no sessions

template <typename Function>
Eigen::VectorXd values_of(const std::vector<Block>& blocks, const Function& function) {
  Eigen::VectorXd v(std::ssize(blocks));
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    v[i] = function(blocks[static_cast<std::size_t>(i)]);
  }
  return v;
}

double span(const Eigen::VectorXd& v) { return v.maxCoeff() - v.minCoeff(); }

// cos(k pi u) with u from 0 to 1 over the span; slower ones have more weight.
Factor smooth(std::string name, const Eigen::VectorXd& v, int count, bool in_time) {
  const Eigen::VectorXd u = (v.array() - v.minCoeff()) / std::max(1e-9, span(v));
  Factor factor{std::move(name), Eigen::MatrixXd(u.size(), count), {}, in_time};
  for (int k = 1; k <= count; ++k) {
    factor.value.col(k - 1) = (k * M_PI * u.array()).cos();
    factor.weight.push_back(1.0 / k);
  }
  return factor;
}

Factor even(std::string name, Eigen::Index blocks, Eigen::Index functions) {
  return {std::move(name), Eigen::MatrixXd::Zero(blocks, functions),
          std::vector<double>(static_cast<std::size_t>(functions), 1), false};
}

void add_session(const std::vector<Block>& blocks, std::vector<Factor>& factors) {
  std::map<int, int> sessions;
  for (const Block& block : blocks) {
    sessions.emplace(block.session, static_cast<int>(sessions.size()));
  }
  if (sessions.size() > 1 && sessions.size() <= kMostSessions) {
    Factor factor = even("session", std::ssize(blocks), std::ssize(sessions));
    for (Eigen::Index i = 0; i < factor.value.rows(); ++i) {
      factor.value(i, sessions[blocks[static_cast<std::size_t>(i)].session]) = 1;
    }
    factors.push_back(std::move(factor));
  }
}

// The temperature less those that lag behind it.
Factor history(const Eigen::VectorXd& time_s, const Eigen::VectorXd& temperature_c) {
  Factor factor = even("the way of the temperature", time_s.size(), std::ssize(kLag_s));
  for (std::size_t k = 0; k < kLag_s.size(); ++k) {
    double lagging = temperature_c[0];
    for (Eigen::Index i = 1; i < time_s.size(); ++i) {
      lagging += (temperature_c[i] - lagging) *
                 -std::expm1(-std::max(0.0, time_s[i] - time_s[i - 1]) / kLag_s[k]);
      factor.value(i, static_cast<Eigen::Index>(k)) = (temperature_c[i] - lagging) / kLagUnit_c;
    }
  }
  return factor;
}

// The axis about which the unit was last turned, in the sensor; none for half a turn, which may
// have gone about any axis.
Factor last_turn(const std::vector<Block>& blocks) {
  constexpr double kTurned_rad = 0.05;
  constexpr double kHalfTurn_rad = 3;
  Factor factor = even("the turn before", std::ssize(blocks), 3);
  Eigen::Matrix3d before = blocks.front().rotation;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < factor.value.rows(); ++i) {
    const Eigen::Matrix3d& now = blocks[static_cast<std::size_t>(i)].rotation;
    const Eigen::AngleAxisd turn(now * before.transpose());
    if (turn.angle() > kTurned_rad) {
      axis = turn.angle() < kHalfTurn_rad ? turn.axis() : Eigen::Vector3d::Zero();
      before = now;
    }
    factor.value.row(i) = axis.transpose();
  }
  return factor;
}

// Direction of the room's horizontal axes in the sensor; of gravity, to second order; the step
// before the dwell, and the turn that made it.
void add_orientation(const std::vector<Block>& blocks, std::vector<Factor>& factors) {
  const Eigen::Index n = std::ssize(blocks);
  Factor room = even("direction in the room", n, 6);
  Factor pose = even("pose", n, 8);
  Factor approach = even("side of approach", n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Block& block = blocks[static_cast<std::size_t>(i)];
    const Eigen::Vector3d u = block.rotation.col(2);
    pose.value.row(i) << u[0], u[1], u[2], u[0] * u[0] - u[2] * u[2], u[1] * u[1] - u[2] * u[2],
        u[0] * u[1], u[1] * u[2], u[0] * u[2];
    approach.value.row(i) << block.approach_g.transpose() / 2,
        block.held_sign.col(kUsualStep).transpose();
    room.value.row(i) << block.rotation.col(0).transpose(), block.rotation.col(1).transpose();
  }
  factors.push_back(std::move(room));
  factors.push_back(std::move(pose));
  if (approach.value.squaredNorm() > 0) {
    factors.push_back(std::move(approach));
  }
  if (Factor turn = last_turn(blocks); turn.value.squaredNorm() > 0) {
    factors.push_back(std::move(turn));
  }
}

}  // namespace

std::vector<Factor> factors_of(const std::vector<Block>& blocks) {
  std::vector<Factor> factors;
  const auto time_s = values_of(blocks, [](const Block& b) { return b.middle_s; });
  const auto temperature_c = values_of(blocks, [](const Block& b) { return b.temperature_c; });
  const bool warmed = span(temperature_c) > kLeastSpan_c;
  factors.push_back(smooth("time", time_s, kCosinesOfTime, true));
  if (warmed) {
    factors.push_back(smooth("temperature", temperature_c, kCosinesOfTemperature, false));
  }
  add_session(blocks, factors);
  if (warmed) {
    factors.push_back(history(time_s, temperature_c));
  }
  add_orientation(blocks, factors);
  if (std::any_of(blocks.begin(), blocks.end(), [](const Block& b) { return b.tone; })) {
    Factor shaken = even("vibration", std::ssize(blocks), 2);
    shaken.weight[1] = 0.5;
    shaken.value.col(0) = values_of(blocks, [](const Block& b) { return b.tone ? 1 : 0; });
    shaken.value.col(1) =
        values_of(blocks, [](const Block& b) { return b.vibration_lab_g.norm(); });
    factors.push_back(std::move(shaken));
  }
  return factors;
}

}  // namespace sixpoint::gap
