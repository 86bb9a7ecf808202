// Parameters that are not constant throughout the recording.
#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

TEST(EvidenceConstancy, ConstantParametersHaveNone) {
  for (const unsigned seed : {7U, 8U, 9U}) {
    const auto blocks = tests::made_dwells({}, seed);
    for (const Inconstancy& change : Explanation(blocks, only({})).inconstancies()) {
      EXPECT_LT(change.nats, 5) << change.term << " with " << change.factor;
    }
  }
}

TEST(EvidenceConstancy, AZeroThatFollowsTheSessionIsFound) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return b.session == 1 ? Eigen::Vector3d(2, 1, -2) : Eigen::Vector3d(0, 0, 0);
  });
  const auto found = Explanation(blocks, only({})).inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().factor, "session");
  EXPECT_EQ(found.front().term, "the zero");
  EXPECT_GT(found.front().nats, 50);
}

TEST(EvidenceConstancy, AGainThatFollowsTheTemperatureIsFound) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return 0.3 * (b.temperature_c - 25) * b.rotation.col(2);
  });
  const Explanation explanation(blocks, only({}));
  const auto found = explanation.inconstancies();
  ASSERT_FALSE(found.empty());
  EXPECT_NE(found.front().factor.find("temperature"), std::string::npos);
  EXPECT_EQ(found.front().term, "the gain");
}

}  // namespace
}  // namespace sixpoint::gap
