// Plain recordings: real files of others, with what their makers say of them as the oracle.
#include "gap/plain.h"

#include <cstdio>

#include <gtest/gtest.h>
#include <zlib.h>

#include "expect_result.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

const EffectFinding* accepted(const Diagnosis& d, const std::string& name) {
  for (const EffectFinding& e : d.effects) {
    if (e.name == name) {
      return &e;
    }
  }
  return nullptr;
}

TEST(Plain, AffectedUnitsHaveTheWrongFilter) {
  for (const char* name :
       {"data/wgt3x-bt-affected/MOS2A45130450.gt3x", "data/wgt3x-bt-affected/MOS2A45130451.gt3x"}) {
    SIXPOINT_NEED_SHARED(name);
    const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
    ASSERT_OK(d);
    ASSERT_FALSE(d->effects.empty()) << name;
    EXPECT_EQ(d->effects.front().name, "filter_mismatch");
    EXPECT_GT(d->not_observable.size(), 20U);
  }
}

TEST(Plain, UnaffectedUnitHasNoGap) {
  const char* name = "data/wgt3x-bt/MOS2E39180594.gt3x";
  SIXPOINT_NEED_SHARED(name);
  const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
  ASSERT_OK(d);
  EXPECT_EQ(accepted(*d, "filter_mismatch"), nullptr);
  EXPECT_EQ(d->verdict, Verdict::no_gap);
}

// PROVENANCE.md: drift about -0.16, -0.40, -0.43 mg/C, a chamber run at 0, 20 and 30 C.
TEST(Plain, ChamberRunHasTheVendorsDrift) {
  const char* name = "data/agdc/CPW1C48210013_baseline.agdc";
  SIXPOINT_NEED_SHARED(name);
  const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
  ASSERT_OK(d);
  const EffectFinding* tempco = accepted(*d, "offset_tempco");
  ASSERT_NE(tempco, nullptr);
  const auto& k = tempco->parameters.front().value;
  EXPECT_NEAR(k[0], -0.16, 0.06);
  EXPECT_NEAR(k[1], -0.40, 0.06);
  EXPECT_NEAR(k[2], -0.43, 0.06);
}

// Factory values of this Xsens unit: scale 415, 413, 415 counts per m/s2, bias 33123, 33276, 32360,
// cross-axis terms of 0.01 to 0.02; local gravity 9.81744 m/s2.
TEST(Plain, XsensLengthsGiveTheFactorysScalesAndCrossTerms) {
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

TEST(Plain, TooFewPositionsAreRefused) {
  EXPECT_FAILS(fit_lengths(std::vector<Eigen::Vector3d>(5, Eigen::Vector3d::UnitX()), 1),
               ErrorCode::bad_data);
  EXPECT_FAILS(fit_lengths(std::vector<Eigen::Vector3d>(40, Eigen::Vector3d::UnitX()), 1),
               ErrorCode::bad_data);
}

TEST(Plain, MissingFileIsNoInput) {
  EXPECT_FAILS(diagnose_plain(posix_env().files, "/nonexistent/a.gt3x"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::gap
