// A small version of bench/repair_bench: made units with a known true motion, and the mistakes that
// people make with constants.
#include <gtest/gtest.h>

#include "repair/trial_run.h"

namespace sixpoint::repair {
namespace {

TEST(RepairTrials, NoFileGetsWorseAndNoGoodRepairIsRefused) {
  const auto result = tests::run_trials(7, 12);
  for (const auto& [kind, count] : result.kinds) {
    EXPECT_EQ(count.worse, 0) << kind << "\n" << count.examples;
  }
  EXPECT_EQ(result.of("good").written, 12) << result.of("good").examples;
  EXPECT_EQ(result.of("withdrawn, a good set left").written, 12);
  EXPECT_EQ(result.of("already corrected").written, 0);
  EXPECT_EQ(result.of("all withdrawn").written, 0);
  EXPECT_EQ(result.of("swapped calibration file").written, 0);
  EXPECT_GT(result.of("wrong unit").refused, 8);
}

}  // namespace
}  // namespace sixpoint::repair
