// Stored jig runs: as bundles, and what many of them have in common.
#include "station/gap_trends.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/constants.h"
#include "base/random.h"
#include "device/jig.h"
#include "expect_result.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using Json = nlohmann::json;

// A report as a jig run leaves it: a unit with its own small turn (degrees) on a jig that tilts all
// units alike.
StoredRun made_run(const std::string& serial, const std::string& jig,
                   const std::array<double, 3>& unit_deg, const std::array<double, 2>& jig_deg) {
  constexpr double kRad = 3.14159265358979323846 / 180;
  Json poses = Json::array();
  for (const device::Pose pose : device::kPoses) {
    const PerAxis<double> up = device::direction_of(pose);
    // The jig: along the next two axes of whatever face is up. The unit: a small rotation.
    PerAxis<double> seen = up;
    const std::size_t axis = device::axis_of(pose);
    seen[(axis + 1) % 3] += jig_deg[0] * kRad;
    seen[(axis + 2) % 3] += jig_deg[1] * kRad;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      const std::size_t c = (a + 2) % 3;
      seen[a] += kRad * (unit_deg[b] * up[c] - unit_deg[c] * up[b]);
    }
    Json mean = Json::array();
    for (std::size_t a = 0; a < 3; ++a) {
      mean.push_back(20.0 + 5.0 * static_cast<double>(a) + 250.0 * seen[a]);
    }
    poses.push_back({{"pose", device::to_string(pose)}, {"mean_lsb", mean}, {"samples", 600}});
  }
  return {"id" + serial, serial, "jig", "bench 1", jig, Json{{"poses", poses}}.dump()};
}

std::vector<StoredRun> runs_on(const std::string& jig, std::size_t units,
                               const std::array<double, 2>& jig_deg, std::uint64_t seed) {
  Random random(seed, 1);
  std::vector<StoredRun> runs;
  for (std::size_t u = 0; u < units; ++u) {
    const std::array<double, 3> own = {0.2 * random.normal(), 0.2 * random.normal(),
                                       0.2 * random.normal()};
    runs.push_back(made_run(jig + std::to_string(u), jig, own, jig_deg));
  }
  return runs;
}

TEST(GapTrends, SkewIsReadOffTheFaces) {
  const auto skew = skew_of_run(made_run("A", "j", {0, 0, 0}, {0.3, 0}));
  ASSERT_OK(skew);
  double most = 0;
  for (const double x : *skew) {
    most = std::max(most, std::abs(x));
  }
  EXPECT_NEAR(most, 0.3, 0.002);
  EXPECT_FAILS(skew_of_run({"x", "s", "jig", "", "", "{}"}), ErrorCode::bad_data);
  EXPECT_FAILS(skew_of_run({"x", "s", "jig", "", "", "nonsense"}), ErrorCode::bad_data);
}

TEST(GapTrends, SameTiltOnEveryUnitIsTheJigs) {
  auto runs = runs_on("level", 14, {0, 0}, 1);
  for (auto& run : runs_on("crooked", 14, {0.4, -0.2}, 2)) {
    runs.push_back(run);
  }
  for (auto& run : runs_on("rare", 3, {0.4, -0.2}, 3)) {
    runs.push_back(run);
  }
  const GapTrends trends = find_trends(runs);
  ASSERT_EQ(trends.jigs.size(), 3U);
  for (const JigTrend& trend : trends.jigs) {
    EXPECT_EQ(trend.owner, trend.jig == "crooked" ? Owner::jig
                           : trend.jig == "rare"  ? Owner::too_few
                                                  : Owner::unit)
        << trend.jig << " " << trend.chance;
  }
}

TEST(GapTrends, WhatTwoJigsShareIsTheStations) {
  auto runs = runs_on("a", 12, {0.4, 0.3}, 4);
  for (auto& run : runs_on("b", 12, {0.4, 0.3}, 5)) {
    runs.push_back(run);
  }
  for (const JigTrend& trend : find_trends(runs).jigs) {
    EXPECT_EQ(trend.owner, Owner::station) << trend.chance;
  }
}

// The oracle is the test's own definition: with level jigs the chance must be uniform.
TEST(GapTrends, LevelJigsAreRarelyBlamed) {
  int blamed = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto trends = find_trends(runs_on("level", 10, {0, 0}, 100 + seed));
    blamed += trends.jigs.front().owner == Owner::jig ? 1 : 0;
  }
  EXPECT_LE(blamed, 10) << "four in a hundred are expected";
}

TEST(JigBundle, AStoredRunIsDiagnosed) {
  tests::TemporaryFolder folder;
  const std::string store = folder / "s.db";
  const auto jig =
      tests::run_command(posix_env(), {"jig", "--device", "virtual:seed=9,jig=auto", "--jig",
                                       "virtual", "--store", store, "--json"});
  ASSERT_EQ(jig.exit_code, 0) << jig.people;
  const std::string run = jig.json()["run"].get<std::string>();
  const auto diagnosed = tests::run_command(
      posix_env(), {"gap", "diagnose", "--run", run, "--store", store, "--json"});
  EXPECT_EQ(diagnosed.exit_code, 0) << diagnosed.people;
  const Json json = Json::parse(diagnosed.out);
  EXPECT_EQ(json["verdict"], "no_gap");
  bool mismatch = false;
  for (const Json& hidden : json["not_observable"]) {
    mismatch = mismatch || hidden["name"] == "filter_mismatch";
  }
  EXPECT_TRUE(mismatch) << "raw counts do not show it";
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", "--run", "00ff", "--store", store})
                .exit_code,
            66);
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose"}).exit_code, 64);
  const auto trends =
      tests::run_command(posix_env(), {"gap", "trends", "--store", store, "--json"});
  EXPECT_EQ(trends.exit_code, 2) << "one unit tells nothing";
  EXPECT_EQ(Json::parse(trends.out)["jigs"][0]["belongs_to"], "too_few_units");
}

TEST(GapCommand, TakesATableOfReadings) {
  tests::TemporaryFolder folder;
  const std::string table = folder / "t.csv";
  ASSERT_OK(write_file(posix_env().files, table, "x,y,z\n1,2,3\n"));
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", table}).exit_code, 64);
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", table, "--rate", "30"}).exit_code,
            2);
}

TEST(JigBundle, WhatDoesNotBelongTogetherIsRefused) {
  const StoredRun run = made_run("A", "j", {0, 0, 0}, {0, 0});
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,2,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,nan,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, ""), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run({"i", "s", "jig", "", "", "[]"}, ""), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::station
