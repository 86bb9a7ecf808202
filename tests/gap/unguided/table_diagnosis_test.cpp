// The diagnosis of a table of readings (readings_table.h).
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/unguided/made_table.h"
#include "gap/unguided/readings_table.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

using tests::diagnosed_table;
using tests::MadeTable;
using tests::table_of;

TEST(TableDiagnosis, KnownCrossTermsAreFound) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MadeTable made;
    made.cross = {0.004, -0.008, 0.012};
    made.timed = seed % 2 == 0;
    ReadingsTableOptions table;
    table.rate_hz = 100;
    const auto d = diagnosed_table(table_of(made, seed), {}, table);
    ASSERT_OK(d);
    ASSERT_EQ(d->effects.size(), 1U) << seed;
    EXPECT_EQ(d->effects[0].name, "non_orthogonality");
    EXPECT_EQ(d->verdict, Verdict::explained);
    const NamedValue& terms = d->effects[0].parameters.front();
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(terms.value[a], made.cross[static_cast<Eigen::Index>(a)], 5 * terms.sd[a] + 1e-4);
      EXPECT_LT(terms.sd[a], 2e-3);
    }
    EXPECT_LT(d->gap.after_mg, 0.2 * d->gap.before_mg);
    // Without it in the catalogue the gap is still there, and nothing takes its place.
    DiagnoseOptions stripped;
    stripped.without = {"non_orthogonality"};
    const auto without = diagnosed_table(table_of(made, seed), stripped, table);
    ASSERT_OK(without);
    EXPECT_TRUE(without->effects.empty());
    EXPECT_TRUE(without->unknown.present);
    EXPECT_EQ(without->verdict, Verdict::unexplained);
  }
}

TEST(TableDiagnosis, SquareAxesRaiseNoAlarm) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const auto d = diagnosed_table(table_of({}, seed));
    ASSERT_OK(d);
    EXPECT_FALSE(d->inconclusive);
    alarms += d->verdict == Verdict::no_gap ? 0 : 1;
  }
  EXPECT_EQ(alarms, 0);
}

// Factory values: scale 415, 413, 415 counts per m/s2, cross-axis terms of 0.01 to 0.02
// (PROVENANCE.md). Half of each is seen: lengths show the symmetric part alone.
TEST(TableDiagnosis, XsensAxesAreNotSquare) {
  const char* name = "data/multiposition/xsens_acc.txt.gz";
  SIXPOINT_NEED_SHARED(name);
  const auto d = diagnose_table(posix_env().files, tests::shared_file(name));
  ASSERT_OK(d);
  ASSERT_EQ(d->effects.size(), 1U);
  EXPECT_EQ(d->effects[0].name, "non_orthogonality");
  double worst = 0;
  for (const double term : d->effects[0].parameters.front().value) {
    EXPECT_LT(std::abs(term), 0.02);
    worst = std::max(worst, std::abs(term));
  }
  EXPECT_GT(worst, 0.005);
  EXPECT_LT(d->gap.after_mg, 0.5);
  EXPECT_GT(d->gap.closed_fraction, 0.99);
}

// Nothing that was measured in a few directions, or never at rest, settles nine constants.
TEST(TableDiagnosis, TooLittleIsInconclusive) {
  for (const int directions : {1, 6, 12}) {
    MadeTable made;
    made.directions = directions;
    const auto d = diagnosed_table(table_of(made, 3));
    ASSERT_OK(d);
    EXPECT_TRUE(d->inconclusive) << directions;
    EXPECT_EQ(d->verdict, Verdict::unexplained) << directions;
    EXPECT_NE(d->losses.back().find("do not settle nine constants"), std::string::npos);
    EXPECT_TRUE(d->effects.empty());
  }
  std::string constant;
  for (int i = 0; i < 10'000; ++i) {
    constant += fmt::format("{:.2f} 7 7 7\n", i * 0.01);
  }
  const auto d = diagnosed_table(constant);
  ASSERT_OK(d);
  EXPECT_TRUE(d->inconclusive);
}

}  // namespace
}  // namespace sixpoint::gap
