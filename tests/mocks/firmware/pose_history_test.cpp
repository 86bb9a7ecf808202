#include "mocks/firmware/pose_history.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace sixpoint::mocks {
namespace {

// The specific force at rest is gravity along the axis that points up.
Eigen::Vector3d force_g(PoseHistory& poses, double time_s) {
  sim::MotionState state;
  poses.at(time_s, state);
  return state.rotation * state.force_lab_g;
}

TEST(PoseHistory, TurnsEndInTheirPose) {
  PoseHistory poses(0.999, 0, 7);
  EXPECT_LT((force_g(poses, 0) - Eigen::Vector3d(0, 0, 0.999)).norm(), 1e-9);
  poses.turn_to({1, 0, 0}, 10, 2, 0);
  EXPECT_TRUE(poses.is_turning(11));
  EXPECT_FALSE(poses.is_turning(12));
  EXPECT_LT((force_g(poses, 13) - Eigen::Vector3d(0.999, 0, 0)).norm(), 1e-9);
  EXPECT_LT((force_g(poses, 9) - Eigen::Vector3d(0, 0, 0.999)).norm(), 1e-9) << "the past stays";
}

TEST(PoseHistory, ATiltIsTheAngleBetweenForceAndAxis) {
  PoseHistory poses(1, 0, 7);
  poses.turn_to({0, 1, 0}, 0, 1, 3);
  const double cosine = force_g(poses, 5).normalized().dot(Eigen::Vector3d(0, 1, 0));
  EXPECT_NEAR(std::acos(cosine) * 180 / std::numbers::pi, 3, 1e-6);
}

TEST(PoseHistory, AStoppedTurnStaysWhereItIs) {
  PoseHistory poses(1, 0, 7);
  poses.turn_to({1, 0, 0}, 0, 2, 0);
  poses.stop(1);
  EXPECT_FALSE(poses.is_turning(1));
  const Eigen::Vector3d stopped = force_g(poses, 1.5);
  EXPECT_LT((force_g(poses, 9) - stopped).norm(), 1e-12);
  EXPECT_LT(stopped[0], 0.99);
  EXPECT_LT(stopped[2], 0.99);
}

// The axes that lay level point the other way, seen from the laboratory; the one that points up
// does not.
TEST(PoseHistory, AHalfTurnIsAboutTheVertical) {
  for (const Eigen::Vector3d& up :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, 1)}) {
    PoseHistory poses(1, 0, 7);
    sim::MotionState plain;
    sim::MotionState turned;
    poses.turn_to(up, 0, 1, 0);
    poses.at(5, plain);
    poses.turn_to(up, 10, 1, 0, true);
    poses.at(15, turned);
    EXPECT_LT((turned.rotation.col(0) + plain.rotation.col(0)).norm(), 1e-9);
    EXPECT_LT((turned.rotation.col(1) + plain.rotation.col(1)).norm(), 1e-9);
    EXPECT_LT((turned.rotation.col(2) - up).norm(), 1e-9);
    EXPECT_NEAR(turned.rotation.determinant(), 1, 1e-9);
  }
}

}  // namespace
}  // namespace sixpoint::mocks
