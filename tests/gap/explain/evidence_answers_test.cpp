// What can be asked about the best explanation.
#include <gtest/gtest.h>

#include "gap/explain/explanation.h"
#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

using tests::only;

// Leverages of a least-squares fit add up to its number of parameters; the priors of six nuisances
// are wide.
TEST(EvidenceAnswers, FreedomOfRowsIsRowsLessParameters) {
  const auto blocks = tests::made_dwells({}, 3);
  const Explanation explanation(blocks, only({}));
  double sum = 0;
  for (const double freedom : explanation.row_freedom()) {
    EXPECT_GE(freedom, 0);
    EXPECT_LE(freedom, 1);
    sum += freedom;
  }
  EXPECT_NEAR(sum, 54 - 6, 0.01);
}

// One group of parameters with prior sd p, measured with sd s: the posterior is s p / hypot(s, p).
TEST(EvidenceAnswers, UndeterminedIsPosteriorOverPrior) {
  const auto blocks = tests::made_dwells({}, 4);
  const Explanation explanation(blocks, only({"tilt", "third_order"}));
  EXPECT_LT(explanation.undetermined("tilt"), 0.1);
  EXPECT_GT(explanation.undetermined("third_order"), 0.9) << "1 g alone: it looks like a gain";
  EXPECT_GT(explanation.expected_nats("tilt"), kAccept_nats);
  EXPECT_LT(explanation.expected_nats("third_order"), kAccept_nats);
  EXPECT_GT(explanation.expected_nats("truncation"), 1e200) << "not asked for: no smallest size";
}

}  // namespace
}  // namespace sixpoint::gap
