// Derivatives by the parameters, and rows divided by the root of their covariance.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/explain/evidence.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

TEST(EvidenceWhiten, ColumnsAreTheDerivatives) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  const Eigen::MatrixXd x = model.linearise({});
  const int gain = model.first_column(0);
  const int offset = model.first_column(1);
  const int drift = model.first_column(model.groups_of("drift").front());
  for (Eigen::Index i = 0; i < model.rows(); i += 3) {
    const Block& block = model.block_of_row(i);
    EXPECT_NEAR(x(i, gain), 1000 * block.rotation(0, 2), 1e-6);
    EXPECT_NEAR(x(i + 1, offset + 1), 1, 1e-9);
    EXPECT_NEAR(x(i + 2, drift + 2), block.middle_s / 3600, 1e-8);
    EXPECT_NEAR(x(i, drift + 2), 0, 1e-9) << "another axis";
    EXPECT_EQ(model.feature_of_row(static_cast<int>(i) + 2), 2);
  }
}

TEST(EvidenceWhiten, WhiteningGivesUnitVariance) {
  // Chi-square of 54 rows whose covariance is the model's own: 54 +- 10.
  double chi = 0;
  constexpr int kSeeds = 20;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const auto blocks = tests::made_dwells({}, seed);
    const EvidenceModel model(blocks, {});
    Eigen::MatrixXd rows(model.rows(), 1);
    for (Eigen::Index i = 0; i < rows.rows(); i += 3) {
      const Block& block = model.block_of_row(i);
      rows.block<3, 1>(i, 0) = block.value_mg - 1000 * block.rotation.col(2);
    }
    model.whiten_rows(Scatter::nominal, 0, rows);
    chi += rows.squaredNorm() / kSeeds;
  }
  EXPECT_NEAR(chi, 54, 4 * std::sqrt(2 * 54.0 / kSeeds));
}

// A matrix L with V = L L' takes the unit matrix to its inverse: R V R' is the unit matrix, and
// half the logarithm of det V is known from V itself. V by hand: noise, seating of the
// placement, and the kernel of the scatter on each axis, which scatter_test.cpp checks. A seat that
// walks has taken i + 1 independent steps at placement i.
TEST(EvidenceWhiten, RowsAreDividedByTheRootOfTheCovariance) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  const double start_s = blocks.front().middle_s - blocks.front().seconds / 2;
  const Eigen::Index n = model.rows();
  for (const Scatter scatter : {Scatter::nominal, Scatter::seating, Scatter::random_walk,
                                Scatter::flicker, Scatter::by_placement, Scatter::by_session,
                                Scatter::seat_walks, Scatter::by_temperature, Scatter::by_time}) {
    constexpr double kSize = 0.3;
    const bool seats = scatter == Scatter::seating;
    const bool walks = scatter == Scatter::seat_walks;
    const double seat_deg = seats ? std::hypot(kNominalSeating_deg, kSize) : kNominalSeating_deg;
    const bool zeros = scatter != Scatter::nominal && !seats && !walks;
    Eigen::MatrixXd v = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const auto ri = static_cast<Eigen::Index>(3 * i);
      const Eigen::MatrixXd lever = seat_deg * seating_lever(blocks[i]);
      // Cosines of the turns about the two axes across gravity, to second order.
      const Eigen::Vector3d off_mg =
          500 * std::pow(seat_deg * M_PI / 180, 2) * std::sqrt(8.0) * blocks[i].rotation.col(2);
      v.block<3, 3>(ri, ri) =
          blocks[i].white_mg2 + lever * lever.transpose() + off_mg * off_mg.transpose();
      for (std::size_t j = 0; j < blocks.size() && zeros; ++j) {
        const auto rj = static_cast<Eigen::Index>(3 * j);
        v.block<3, 3>(ri, rj).diagonal().array() +=
            kSize * kSize * scatter_kernel(scatter, blocks[i], blocks[j], start_s);
      }
      for (std::size_t j = 0; j < blocks.size() && walks; ++j) {
        const auto steps = static_cast<double>(std::min(i, j) + 1);
        v.block<3, 3>(ri, static_cast<Eigen::Index>(3 * j)) +=
            kSize * kSize * steps * seating_lever(blocks[i]) * seating_lever(blocks[j]).transpose();
      }
    }
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(n, n);
    const double half_log_det = model.whiten_rows(scatter, kSize, root);
    const Eigen::MatrixXd unit = root * v * root.transpose();
    EXPECT_LT((unit - Eigen::MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(), 1e-4)
        << to_string(scatter);
    const Eigen::VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(v).eigenvalues();
    EXPECT_NEAR(half_log_det, 0.5 * eigenvalues.array().log().sum(), 1e-3) << to_string(scatter);
  }
}

// Bad seats beside a walk: whitened, the covariance of both is the identity. Oracle: the walk's alone
// and what seats of the same size add alone.
TEST(EvidenceWhiten, SeatsAddToSlowNoise) {
  constexpr double kWalk = 0.3;
  constexpr double kSeats_deg = 0.1;
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  const Eigen::Index n = model.rows();
  const auto covariance = [&](Scatter scatter, double size) {
    Eigen::MatrixXd root = Eigen::MatrixXd::Identity(n, n);
    model.whiten_rows(scatter, size, root);
    const Eigen::MatrixXd back = root.inverse();
    return Eigen::MatrixXd(back * back.transpose());
  };
  Eigen::MatrixXd root = Eigen::MatrixXd::Identity(n, n);
  model.whiten_rows(Scatter::random_walk, kWalk, root, kSeats_deg);
  const Eigen::MatrixXd both = covariance(Scatter::random_walk, kWalk) +
                               covariance(Scatter::seating, kSeats_deg) -
                               covariance(Scatter::nominal, 0);
  EXPECT_LT(
      (root * both * root.transpose() - Eigen::MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(),
      1e-3);
  const double both_nats =
      model.whiten(model.linearise({}), Scatter::random_walk, kWalk, kSeats_deg).outside_nats;
  EXPECT_NEAR(both_nats,
              scatter_log_prior(Scatter::random_walk) + scatter_log_prior(Scatter::seating), 1e-12);
}

// What the records say of a size, and the size's prior, are added outside of the rows.
TEST(EvidenceWhiten, RecordsAndPriorOfTheSizeStandOutside) {
  const auto blocks = tests::made_dwells();
  EvidenceOptions options;
  options.record_nats = [](Scatter, double size) { return 100 * size; };
  const EvidenceModel model(blocks, options);
  const Eigen::MatrixXd linear = model.linearise({});
  EXPECT_EQ(model.whiten(linear, Scatter::nominal, 0).outside_nats, 0);
  EXPECT_NEAR(model.whiten(linear, Scatter::flicker, 0.2).outside_nats,
              20 + scatter_log_prior(Scatter::flicker), 1e-12);
}

}  // namespace
}  // namespace sixpoint::gap
