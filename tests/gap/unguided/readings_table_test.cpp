#include "gap/unguided/readings_table.h"

#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "base/random.h"
#include "expect_result.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

using testing::HasSubstr;

struct Made {
  Eigen::Vector3d cross = Eigen::Vector3d::Zero();  // yz xz xy
  int directions = 40;
  bool timed = true;
  double noise_g = 0.003;
};

// The forward model in closed form: counts = gain * (M * direction) + zero, with noise and
// rounding.
std::string table_of(const Made& made, std::uint64_t seed) {
  Random random(seed);
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  m(1, 2) = m(2, 1) = made.cross[0];
  m(0, 2) = m(2, 0) = made.cross[1];
  m(0, 1) = m(1, 0) = made.cross[2];
  const Eigen::Vector3d gain(4100, 3900, 4000);
  const Eigen::Vector3d zero(300, -200, 50);
  std::string text = made.timed ? "time_s,x,y,z\n" : "x;y;z\n";
  double time_s = 5;
  for (int i = 0; i < made.directions; ++i) {
    Eigen::Vector3d up(random.normal(), random.normal(), random.normal());
    up.normalize();
    for (int k = 0; k < 700; ++k) {
      Eigen::Vector3d g = m * up;
      for (Eigen::Index a = 0; a < 3; ++a) {
        // The last second is the turn to the next direction.
        g[a] += (k < 600 ? made.noise_g : 0.4) * random.normal();
      }
      const Eigen::Vector3d counts = gain.cwiseProduct(g) + zero;
      if (made.timed) {
        text +=
            fmt::format("{:.4f},{:.0f},{:.0f},{:.0f}\n", time_s, counts[0], counts[1], counts[2]);
      } else {
        text += fmt::format("{:.0f};{:.0f};{:.0f}\r\n", counts[0], counts[1], counts[2]);
      }
      time_s += 0.01;
    }
  }
  return text;
}

Result<Diagnosis> diagnose(const std::string& text, const DiagnoseOptions& options = {},
                           const ReadingsTableOptions& table = {}) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "t.csv", text));
  return diagnose_table(memory.files, "t.csv", options, table);
}

TEST(ReadingsTable, NamesOfTables) {
  EXPECT_TRUE(is_readings_table("a/b.txt.gz"));
  EXPECT_TRUE(is_readings_table("b.csv"));
  EXPECT_FALSE(is_readings_table("b.gt3x"));
  EXPECT_FALSE(is_readings_table("b.gz"));
}

TEST(ReadingsTable, KnownCrossTermsAreFound) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Made made;
    made.cross = {0.004, -0.008, 0.012};
    made.timed = seed % 2 == 0;
    ReadingsTableOptions table;
    table.rate_hz = 100;
    const auto d = diagnose(table_of(made, seed), {}, table);
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
    const auto without = diagnose(table_of(made, seed), stripped, table);
    ASSERT_OK(without);
    EXPECT_TRUE(without->effects.empty());
    EXPECT_TRUE(without->unknown.present);
    EXPECT_EQ(without->verdict, Verdict::unexplained);
  }
}

TEST(ReadingsTable, SquareAxesRaiseNoAlarm) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const auto d = diagnose(table_of({}, seed));
    ASSERT_OK(d);
    EXPECT_FALSE(d->inconclusive);
    alarms += d->verdict == Verdict::no_gap ? 0 : 1;
  }
  EXPECT_EQ(alarms, 0);
}

// Factory values: scale 415, 413, 415 counts per m/s2, cross-axis terms of 0.01 to 0.02
// (PROVENANCE.md). Half of each is seen: lengths show the symmetric part alone.
TEST(ReadingsTable, XsensAxesAreNotSquare) {
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

TEST(ReadingsTable, BadTablesAreNamed) {
  const std::string good = table_of({}, 1);
  const auto message = [](const std::string& text) {
    const auto d = diagnose(text);
    EXPECT_FALSE(d);
    return d ? std::string() : d.error().what;
  };
  EXPECT_THAT(message(""), HasSubstr("no readings"));
  EXPECT_THAT(message("t,x,y,z\n"), HasSubstr("no readings"));
  EXPECT_THAT(message("1,2\n"), HasSubstr("line 1"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1,2,3\n0.02,1,2\n"), HasSubstr("line 3"));
  EXPECT_THAT(message("0,1,2,3\n0.01,nan,2,3\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1e400,2,3\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1,2,3x\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3,4,5,6\n0,1,2,3,4,5,6\n"), HasSubstr("line 2"));
  EXPECT_THAT(message(std::string(100'000, '1')), HasSubstr("longer than 4096"));
  EXPECT_THAT(message("3,1,2,3\n2,1,2,3\n1,1,2,3\n"), HasSubstr("rate"));  // time goes back
  EXPECT_THAT(message("5,1,2,3\n5,1,2,3\n5,1,2,3\n"), HasSubstr("rate"));  // or stands
  EXPECT_THAT(message("1,2,3\n1,2,3\n"), HasSubstr("rate must be given"));
  EXPECT_THAT(message(std::string("\x1F\x8B\x08 broken", 10)), HasSubstr("gzip"));
}

TEST(ReadingsTable, ACutGzipIsAnError) {
  const char* name = "data/multiposition/xsens_acc.txt.gz";
  SIXPOINT_NEED_SHARED(name);
  const auto bytes = read_file(posix_env().files, tests::shared_file(name));
  ASSERT_OK(bytes);
  MemoryEnv memory;
  const std::string cut(bytes->begin(), bytes->begin() + static_cast<std::ptrdiff_t>(50'000));
  ASSERT_OK(write_file(memory.files, "cut.txt.gz", cut));
  EXPECT_FAILS(diagnose_table(memory.files, "cut.txt.gz"), ErrorCode::bad_data);
  EXPECT_FAILS(diagnose_table(memory.files, "none.txt"), ErrorCode::no_input);
}

// Nothing that was measured in a few directions, or never at rest, settles nine constants.
TEST(ReadingsTable, TooLittleIsInconclusive) {
  for (const int directions : {1, 6, 12}) {
    Made made;
    made.directions = directions;
    const auto d = diagnose(table_of(made, 3));
    ASSERT_OK(d);
    EXPECT_TRUE(d->inconclusive) << directions;
    EXPECT_TRUE(d->effects.empty());
  }
  std::string constant;
  for (int i = 0; i < 10'000; ++i) {
    constant += fmt::format("{:.2f} 7 7 7\n", i * 0.01);
  }
  const auto d = diagnose(constant);
  ASSERT_OK(d);
  EXPECT_TRUE(d->inconclusive);
}

}  // namespace
}  // namespace sixpoint::gap
