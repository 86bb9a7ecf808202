// --gravity, --latitude, --altitude by the table of gravity_option.h.
#include "cli/gravity_option.h"

#include "expect_result.h"

namespace sixpoint::cli {
namespace {

// Oracle: normal gravity of WGS84 at the equator and at the pole (NIMA TR8350.2, Table 3.4).
TEST(GravityOption, AnswersByItsTable) {
  EXPECT_FALSE(local_gravity({}).value()) << "gravity is unknown";
  EXPECT_NEAR(local_gravity({{}, 0.0, 0}).value()->m_per_s2, 9.7803253359, 1e-9);
  EXPECT_NEAR(local_gravity({{}, 90.0, 0}).value()->m_per_s2, 9.8321849378, 1e-9);
  EXPECT_DOUBLE_EQ(local_gravity({9.81, {}, {}}).value()->m_per_s2, 9.81);
  EXPECT_FAILS(local_gravity({9.78, 10.0, {}}), ErrorCode::usage);
  EXPECT_NEAR(local_gravity({{}, 90.0, {}}).value()->m_per_s2, 9.8321849378, 1e-9);
  EXPECT_FAILS(local_gravity({{}, {}, 500}), ErrorCode::usage);  // an altitude alone
  EXPECT_FAILS(local_gravity({9.0, {}, {}}), ErrorCode::usage);
  EXPECT_FAILS(local_gravity({{}, 91.0, 0}), ErrorCode::usage);
}

}  // namespace
}  // namespace sixpoint::cli
