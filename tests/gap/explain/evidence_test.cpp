#include "gap/explain/evidence.h"

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

TEST(EvidenceModel, FirstGuessIsTheLineThroughTheMeans) {
  auto blocks = tests::made_dwells();
  for (Block& block : blocks) {
    const Eigen::Vector3d up_mg = 1000 * block.rotation.col(2);
    block.value_mg = 1.05 * up_mg + Eigen::Vector3d(20, -10, 5);
  }
  const ForwardState state = EvidenceModel(blocks, {}).first_guess();
  EXPECT_NEAR(state.gain[1], 1.05, 1e-4);  // pulled to 1 by one part in 1200
  EXPECT_NEAR(state.offset_mg[1], -10, 1e-3);
}

// The list of the catalogue by hand: gain 3, offset 3, tilt 2, drift 3 numbers and 18 of its
// ripple, in this order.
TEST(EvidenceModel, OnlyAllowedEffectsHaveColumns) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, tests::only({"tilt", "drift"}));
  ASSERT_EQ(model.group_count(), 9) << "three sizes of each effect, four of one that bends";
  EXPECT_EQ(model.group(0).effect, "gain");
  EXPECT_EQ(model.group(1).effect, "offset");
  EXPECT_EQ(model.columns(), 3 + 3 + 2 + 3 + 18);
  EXPECT_EQ(model.rows(), 18 * 3);
  for (const char* effect : {"tilt", "drift"}) {
    ASSERT_FALSE(model.groups_of(effect).empty()) << effect;
    EXPECT_GE(model.groups_of(effect).front(), kNuisances);
  }
  EXPECT_TRUE(model.groups_of("warm_up").empty());
  EXPECT_TRUE(model.allowed("tilt"));
  EXPECT_FALSE(model.allowed("warm_up"));
}

// Three rows a dwell: row 7 is the Y of the third one.
TEST(EvidenceModel, RowsAreCountedByBlocks) {
  const auto blocks = tests::made_dwells();
  const EvidenceModel model(blocks, {});
  EXPECT_EQ(model.feature_of_row(7), 1);
  EXPECT_EQ(&model.block_of_row(7), &blocks[2]);
}

TEST(EvidenceModel, GroupsStayInOrderBehindTheNuisances) {
  EXPECT_EQ(with_group({2, 5}, 3), (std::vector<int>{2, 3, 5}));
  EXPECT_EQ(with_group({}, 4), std::vector<int>{4});
  EXPECT_EQ(with_nuisances({4, 7}), (std::vector<int>{0, 1, 4, 7}));
}

// By hand: y - 2 x0 - 3 x2.
TEST(EvidenceModel, ResidualTakesOffTheColumnsOfThePosterior) {
  Whitened w;
  w.x.resize(2, 3);
  w.x << 1, 10, 4,  //
      2, 20, 5;
  w.y = Eigen::Vector2d(100, 200);
  const Posterior posterior{Eigen::Vector2d(2, 3), Eigen::Matrix2d::Identity(), {0, 2}};
  EXPECT_EQ(residual_of(w, posterior), Eigen::Vector2d(100 - 2 - 12, 200 - 4 - 15));
  Eigen::Matrix2d used;
  used << 1, 4,  //
      2, 5;
  EXPECT_EQ(used_columns(w.x, posterior), used);
}

}  // namespace
}  // namespace sixpoint::gap
