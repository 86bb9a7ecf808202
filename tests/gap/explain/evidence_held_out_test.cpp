// What an explanation predicts of conditions that it was not fitted to.
#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// What noise and seating leave: 0.13 mg on every axis, 0.1745 mg on the two horizontal ones.
TEST(EvidenceHeldOut, HeldOutFloorInClosedForm) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({}));
  const Explanation::HeldOut held = explanation.held_out();
  EXPECT_EQ(held.rows, 54);
  EXPECT_NEAR(held.floor_mg, std::sqrt(0.13 * 0.13 + 2.0 / 3 * 0.1745 * 0.1745), 1e-4);
  EXPECT_NEAR(held.before_sigma, 1, 0.35);
  EXPECT_EQ(held.before_mg, held.after_mg) << "nothing is accepted";
  EXPECT_EQ(held.tone_before_sigma, 0) << "no tones";
}

}  // namespace
}  // namespace sixpoint::gap
