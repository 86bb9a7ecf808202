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

}  // namespace
}  // namespace sixpoint::gap
