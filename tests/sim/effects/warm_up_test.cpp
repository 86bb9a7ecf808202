#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(WarmUp, CountsFromPowerOn) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 100, 10), at_rest(up(2), 10, 3600, 10)});
  run.effects = {spec("warm_up", {{"mg", {50, 0, 0}}, {"tau_s", {200}}}),
                 spec("drift", {{"mg_per_h", {0, 20, 0}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 10, 0), 50 * std::exp(-0.5), 0.4);
  EXPECT_NEAR(mean_mg(*counts, 10, 10, 0), 0, 0.4);
}

// Oracle: an exponential: all of it at power-on, half of it after tau ln 2, 1 / e after tau.
TEST(WarmUp, DiesAwayExponentially) {
  const auto effect = made_effect("warm_up", {{"mg", {4, -8, 0}}, {"tau_s", {300}}});
  const Eigen::Vector3d cold = sensed_under(*effect, {0, 0, 1}, 25, 0);
  EXPECT_LT((cold - Eigen::Vector3d(0.004, -0.008, 1)).norm(), 1e-12);
  const Eigen::Vector3d half = sensed_under(*effect, {0, 0, 1}, 25, 300 * std::log(2.0));
  EXPECT_LT((half - Eigen::Vector3d(0.002, -0.004, 1)).norm(), 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {0, 0, 1}, 25, 300).x(), 0.0014715178, 1e-9);  // 4 mg / e
  EXPECT_LT(sensed_under(*effect, {0, 0, 1}, 25, 6000).x(), 1e-9);
}

}  // namespace
}  // namespace sixpoint::sim
