#include "station/statistics/distributions.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::station {
namespace {

// Oracle: tables of NIST/SEMATECH e-Handbook 1.3.6.7.
TEST(Distributions, AsInTheTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959964, 1e-6);
  EXPECT_NEAR(chi_square_quantile(0.025, 19), 8.907, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.975, 19), 32.852, 1e-3);
  EXPECT_NEAR(f_upper_tail(3.885, 2, 12), 0.05, 1e-4);
  EXPECT_TRUE(std::isnan(f_upper_tail(1, 0, 5)));
  EXPECT_TRUE(std::isnan(chi_square_quantile(0.5, -1)));
}

}  // namespace
}  // namespace sixpoint::station
