// Derivatives by the parameters, and rows divided by the root of their covariance.
#include <Eigen/Cholesky>

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

}  // namespace
}  // namespace sixpoint::gap
