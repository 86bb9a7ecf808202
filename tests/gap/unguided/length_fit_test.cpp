#include "gap/unguided/length_fit.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/random.h"
#include "expect_result.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

// Readings made with a known matrix, without noise, come back to it exactly.
TEST(LengthFit, ExactReadingsGiveTheMatrixThatMadeThem) {
  Eigen::Matrix3d sensitivity;  // symmetric; m/s2 per count
  sensitivity << 2.4e-3, 1e-5, -2e-5, 1e-5, 2.5e-3, 3e-5, -2e-5, 3e-5, 2.3e-3;
  const Eigen::Vector3d zero(33123, 33276, 32360);
  const Eigen::Matrix3d inverse = sensitivity.inverse();
  Random random(1);
  std::vector<Eigen::Vector3d> raw;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d up(random.normal(), random.normal(), random.normal());
    raw.emplace_back(zero + inverse * (9.81 * up.normalized()));
  }
  const auto fit = fit_lengths(raw, 9.81);
  ASSERT_OK(fit);
  EXPECT_LT((fit->sensitivity - sensitivity).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_LT((fit->zero - zero).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_LT(fit->residual, 1e-8);
  EXPECT_NEAR(fit->cross[0], 2 * 3e-5 / (2.5e-3 + 2.3e-3), 1e-8);   // yz
  EXPECT_NEAR(fit->cross[1], 2 * -2e-5 / (2.4e-3 + 2.3e-3), 1e-8);  // xz
  EXPECT_NEAR(fit->cross[2], 2 * 1e-5 / (2.4e-3 + 2.5e-3), 1e-8);   // xy
}

// Factory values of this Xsens unit: scale 415, 413, 415 counts per m/s2, bias 33123, 33276, 32360,
// cross-axis terms of 0.01 to 0.02; local gravity 9.81744 m/s2.
TEST(LengthFit, XsensLengthsGiveTheFactorysScalesAndCrossTerms) {
  const char* name = "data/multiposition/xsens_acc.txt.gz";
  SIXPOINT_NEED_SHARED(name);
  gzFile file = gzopen(tests::shared_file(name).c_str(), "rb");
  ASSERT_NE(file, nullptr);
  std::vector<Eigen::Vector3d> rows;
  std::array<char, 256> line{};
  while (gzgets(file, line.data(), static_cast<int>(line.size())) != nullptr) {
    double t = 0;
    Eigen::Vector3d x;
    if (std::sscanf(line.data(), "%lf %lf %lf %lf", &t, &x[0], &x[1], &x[2]) == 4) {
      rows.push_back(x);
    }
  }
  gzclose(file);
  ASSERT_GT(rows.size(), 50'000U);
  // Positions: stretches of two seconds without movement, neighbours of one direction joined.
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t i = 0; i + 200 <= rows.size(); i += 200) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Vector3d square = Eigen::Vector3d::Zero();
    for (std::size_t k = i; k < i + 200; ++k) {
      mean += rows[k] / 200;
    }
    for (std::size_t k = i; k < i + 200; ++k) {
      square += (rows[k] - mean).cwiseAbs2() / 200;
    }
    if (std::sqrt(square.maxCoeff()) < 12) {
      positions.push_back(mean);
    }
  }
  ASSERT_GT(positions.size(), 40U);
  const auto fit = fit_lengths(positions, 9.81744);
  ASSERT_OK(fit);
  const std::array<double, 3> scale = {415, 413, 415};
  const std::array<double, 3> bias = {33123, 33276, 32360};
  for (Eigen::Index a = 0; a < 3; ++a) {
    EXPECT_NEAR(1 / fit->sensitivity(a, a), scale[static_cast<std::size_t>(a)], 4) << a;
    EXPECT_NEAR(fit->zero[a], bias[static_cast<std::size_t>(a)], 60) << a;
    EXPECT_LT(std::abs(fit->cross[a]), 0.025) << a;
    EXPECT_LT(fit->cross_sd[a], 0.002) << a;
  }
  EXPECT_GT(fit->cross.cwiseAbs().maxCoeff(), 0.003);
  EXPECT_LT(fit->residual, 0.02);
}

TEST(LengthFit, TooFewPositionsAreRefused) {
  EXPECT_FAILS(fit_lengths(std::vector<Eigen::Vector3d>(5, Eigen::Vector3d::UnitX()), 1),
               ErrorCode::bad_data);
  EXPECT_FAILS(fit_lengths(std::vector<Eigen::Vector3d>(40, Eigen::Vector3d::UnitX()), 1),
               ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gap
