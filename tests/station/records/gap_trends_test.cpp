#include "station/records/gap_trends.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "station/records/made_bench.h"

namespace sixpoint::station {
namespace {

const JigTrend& jig_of(const GapTrends& trends, const std::string& name) {
  for (const JigTrend& jig : trends.jigs) {
    if (jig.jig == name) {
      return jig;
    }
  }
  throw std::runtime_error("no jig " + name);
}

TEST(GapTrends, CausesFollowTheTable) {
  using enum TrendCause;
  struct Row {
    CauseEvidence known;
    TrendCause cause;
  };
  // units, in the store, jig, tilt, face, scatters, lot, station, own
  const Row kRows[] = {
      {{2, 20, true, true, true, true, true, true, 1}, too_few_units},
      {{5, 5, true, true, true, true, true, true, 1}, too_few_units},
      {{3, 6, true, true, true, true, true, true, 1}, jig_or_lot},
      {{3, 6, false, false, false, false, true, false, 1}, jig_or_lot},
      {{3, 6, true, false, true, true, false, true, 1}, face},
      {{3, 6, true, true, true, true, false, true, 1}, jig},
      {{3, 6, true, true, false, false, false, true, 1}, jig},
      {{3, 6, true, false, false, false, false, true, 1}, jig},
      {{3, 6, false, false, false, true, false, true, 1}, face},
      {{3, 6, false, false, false, false, false, true, 1}, station},
      {{3, 6, false, false, false, false, false, false, 0.02}, unit},
      {{3, 6, false, false, false, false, false, false, 0.0199}, none},
  };
  for (const Row& row : kRows) {
    EXPECT_EQ(which_cause(row.known, {}), row.cause)
        << to_string(row.cause) << " in row " << &row - kRows;
  }
  EXPECT_TRUE(is_named(0.95, -2, 2, {}));
  EXPECT_FALSE(is_named(0.94, 2, 2, {}));
  EXPECT_FALSE(is_named(0.99, 1.9, 2, {}));
}

// A jig with three units is judged by what the units of another one scatter.
TEST(GapTrends, ARareJigIsJudgedByTheUnitsOfTheOthers) {
  Random random(1, 1);
  MadeBench level;
  level.jigs = made_jigs(1);
  level.units = 14;
  MadeBench rare;
  rare.jigs = made_jigs(1);
  rare.jigs[0].name = "rare";
  rare.jigs[0].base_deg = {0.3, -0.2};
  rare.units = 3;
  MadeRuns made = made_runs(level, random);
  for (StoredRun& run : made_runs(rare, random).runs) {
    run.serial = "R" + run.serial;
    made.runs.push_back(run);
  }
  const GapTrends trends = find_trends(made.runs);
  EXPECT_EQ(jig_of(trends, "J0").cause, TrendCause::unit);
  EXPECT_TRUE(jig_of(trends, "J0").has_chance);
  const JigTrend& jig = jig_of(trends, "rare");
  EXPECT_EQ(jig.cause, TrendCause::jig);
  EXPECT_EQ(jig.units, 3U);
  EXPECT_FALSE(jig.has_chance) << "three units have four sign patterns";
  EXPECT_NEAR(jig.tilt_deg, std::hypot(0.3, 0.2), 3 * jig.standard_uncertainty_deg);
  // How far its nests are turned, beside how far they lean, three units hardly say.
  EXPECT_LT(jig.standard_uncertainty_deg, 0.05);
}

TEST(GapTrends, WhatAllJigsOfAStationShareIsTheStations) {
  Random random(2, 1);
  MadeBench bench;
  bench.jigs = made_jigs(4, 2);
  for (MadeJig& jig : bench.jigs) {
    if (jig.station == "S0") {
      jig.base_deg = {0.2, 0.1};
    }
  }
  const GapTrends trends = find_trends(made_runs(bench, random).runs);
  for (const JigTrend& jig : trends.jigs) {
    EXPECT_EQ(jig.cause,
              jig.jig == "J0" || jig.jig == "J2" ? TrendCause::station : TrendCause::unit)
        << jig.jig;
  }
  ASSERT_EQ(trends.stations.size(), 2U);
  EXPECT_TRUE(trends.stations[0].skew.is_named);
  EXPECT_EQ(trends.stations[0].jigs, 2U);
  EXPECT_FALSE(trends.stations[1].skew.is_named);
}

TEST(GapTrends, AFaceThatDoesNotRepeatIsNamed) {
  Random random(3, 1);
  MadeBench bench;
  bench.jigs = made_jigs(3);
  bench.jigs[1].face_scatter_deg[device::Pose::minus_z] = 0.15;
  const GapTrends trends = find_trends(made_runs(bench, random).runs);
  for (const JigTrend& jig : trends.jigs) {
    for (const FaceTrend& face : jig.faces) {
      EXPECT_EQ(face.does_not_repeat, jig.jig == "J1" && face.face == device::Pose::minus_z)
          << jig.jig << ' ' << device::to_string(face.face) << ' ' << face.scatter_chance;
    }
  }
}

// A lot and a jig that were only ever measured together: a turn is of one or the other. A base that
// is not level is the jig's all the same, since no unit does that.
TEST(GapTrends, ALotThatWasOnOneJigOnlyIsNotToldApartFromIt) {
  const auto trends_with = [](const MadeJig& odd) {
    Random random(4, 1);
    MadeBench others;
    others.jigs = made_jigs(2);
    others.units = 15;
    MadeRuns made = made_runs(others, random);
    for (const StoredRun& run : made.runs) {
      made.lots[run.serial] = "A";
    }
    for (int u = 0; u < 15; ++u) {
      made.runs.push_back(made_run(made_unit("odd" + std::to_string(u), random), odd, {}, random));
      made.lots[made.runs.back().serial] = "B";
    }
    return find_trends(made.runs, made.lots);
  };
  const GapTrends turned = trends_with({.name = "odd", .nest_deg = {0.6, -0.6, 0.6}});
  EXPECT_EQ(jig_of(turned, "odd").cause, TrendCause::jig_or_lot);
  const GapTrends leaning = trends_with({.name = "odd", .base_deg = {0.3, 0}});
  EXPECT_EQ(jig_of(leaning, "odd").cause, TrendCause::jig);
  EXPECT_TRUE(jig_of(leaning, "odd").not_told_apart_from.empty());
}

// One unit, ten runs on one jig: what is its own and what is the jig's is not said.
TEST(GapTrends, OneUnitIsTooFewHoweverOftenItIsMeasured) {
  Random random(5, 1);
  const MadeUnit unit = made_unit("A", random);
  std::vector<StoredRun> runs;
  for (int i = 0; i < 10; ++i) {
    runs.push_back(made_run(unit, {.base_deg = {0.5, 0.5}}, {}, random));
  }
  const GapTrends trends = find_trends(runs);
  ASSERT_EQ(trends.jigs.size(), 1U);
  EXPECT_EQ(trends.jigs[0].cause, TrendCause::too_few_units);
  EXPECT_EQ(trends.jigs[0].runs, 10U);
  EXPECT_TRUE(trends.unit_changes.empty());
}

// The same unit twice on two jigs is 0 apart by its own skew: the jigs differ, by few units'
// evidence.
TEST(GapTrends, UnitsOnTwoJigsTellTheirTurnsApart) {
  const auto tilt_of = [](double twice) {
    Random random(6, 1);
    MadeBench bench;
    bench.jigs = made_jigs(3);
    bench.units = 8;
    bench.twice = twice;
    bench.jigs[2].nest_deg = {0.25, 0, 0};
    return jig_of(find_trends(made_runs(bench, random).runs), "J2").probability;
  };
  EXPECT_LT(tilt_of(0), 0.5) << "24 units of 0.3 degree hide it";
  EXPECT_GT(tilt_of(1), 0.95);
}

TEST(GapTrends, AUnitThatMovedIsToldWithItsRun) {
  Random random(7, 1);
  std::vector<StoredRun> runs;
  for (int u = 0; u < 8; ++u) {
    MadeUnit unit = made_unit("U" + std::to_string(u), random);
    for (int i = 0; i < 4; ++i) {
      if (u == 3 && i == 2) {
        unit.zero_mg[1] += 8;
      }
      if (u == 5 && i == 1) {
        unit.sensitivity_lsb_per_g[2] *= 1.01;
      }
      runs.push_back(made_run(unit, {}, {}, random, fmt::format("{}-{}", u, i)));
    }
  }
  const GapTrends trends = find_trends(runs);
  ASSERT_EQ(trends.unit_changes.size(), 2U);
  const UnitChange& zero = trends.unit_changes[0];
  EXPECT_EQ(zero.serial, "U3");
  EXPECT_EQ(zero.run, "3-2");
  EXPECT_EQ(zero.quantity, "zero");
  EXPECT_EQ(zero.axis, 1U);
  EXPECT_EQ(zero.runs_before, 2U);
  EXPECT_NEAR(zero.size, 8, 3 * zero.standard_uncertainty);
  const UnitChange& sensitivity = trends.unit_changes[1];
  EXPECT_EQ(sensitivity.serial, "U5");
  EXPECT_EQ(sensitivity.run, "5-1");
  EXPECT_EQ(sensitivity.axis, 2U);
  EXPECT_NEAR(sensitivity.size, 1, 0.1);
}

// 40 degrees warmer moves the zero by 24 mg, as the data sheet has it: no change of the unit.
TEST(GapTrends, WhatTheTemperatureExplainsIsNoChange) {
  Random random(8, 1);
  std::vector<StoredRun> runs;
  for (int u = 0; u < 8; ++u) {
    MadeUnit unit = made_unit("U" + std::to_string(u), random);
    runs.push_back(made_run(unit, {}, {}, random));
    unit.zero_mg[0] += u == 2 ? 20 : 0;
    StoredRun later = made_run(unit, {}, {}, random);
    if (u == 2) {
      auto report = nlohmann::json::parse(later.document);
      for (nlohmann::json* list : {&report["poses"], &report["verification"]["poses"]}) {
        for (nlohmann::json& pose : *list) {
          pose["temperature_c"] = 64.5;
        }
      }
      later.document = report.dump();
    }
    runs.push_back(later);
  }
  EXPECT_TRUE(find_trends(runs).unit_changes.empty());
}

// One unit whose face +x was seated two degrees off, in both rounds.
TEST(GapTrends, ABadlySeatedUnitBlamesNoJig) {
  Random random(12, 1);
  MadeBench bench;
  bench.jigs = made_jigs(3);
  MadeRuns made = made_runs(bench, random);
  MadeJig dirty = bench.jigs[1];
  dirty.face_deg[device::Pose::plus_x] = {2, 0};
  made.runs.push_back(made_run(made_unit("odd", random), dirty, {}, random, "oddrun"));
  const GapTrends trends = find_trends(made.runs);
  for (const JigTrend& jig : trends.jigs) {
    EXPECT_EQ(jig.cause, TrendCause::unit) << jig.jig;
    EXPECT_EQ(jig.units, 6U);
  }
  ASSERT_EQ(trends.badly_seated.size(), 1U);
  EXPECT_EQ(trends.badly_seated[0].run, "oddrun");
  EXPECT_EQ(trends.badly_seated[0].serial, "odd");
  EXPECT_EQ(trends.badly_seated[0].axis, 0U);
  EXPECT_NEAR(trends.badly_seated[0].lean_deg, 1, 0.05);
}

TEST(GapTrends, RunsThatAreNoneAreLeftOut) {
  Random random(9, 1);
  MadeBench bench;
  bench.jigs = made_jigs(2);
  MadeRuns made = made_runs(bench, random);
  const std::size_t good = made.runs.size();
  made.runs.push_back({"x", "s", "jig", "S0", "J0", "{}"});
  made.runs.push_back({"y", "s", "jig", "S0", "J0", "nonsense"});
  const GapTrends trends = find_trends(made.runs);
  EXPECT_EQ(trends.runs, good + 2);
  EXPECT_EQ(trends.left_out, 2U);
  EXPECT_EQ(jig_of(trends, "J0").units, 6U);
  EXPECT_TRUE(find_trends({}).jigs.empty());
  EXPECT_EQ(find_trends({{"x", "s", "jig", "", "", "{}"}}).left_out, 1U);
}

// Bounded work: no table of runs by runs. 60 jigs at 6 stations, two of the jigs tilted.
TEST(GapTrends, ThousandsOfRunsAreJudged) {
  Random random(10, 1);
  MadeBench bench;
  bench.jigs = made_jigs(60, 6);
  bench.units = 20;
  bench.twice = 0.7;
  bench.lots = 20;
  bench.jigs[11].base_deg = {0.1, 0};
  bench.jigs[42].face_deg[device::Pose::plus_z] = {0.2, 0};
  const MadeRuns made = made_runs(bench, random);
  EXPECT_GT(made.runs.size(), 1900U);
  const GapTrends trends = find_trends(made.runs, made.lots);
  for (const JigTrend& jig : trends.jigs) {
    EXPECT_EQ(jig.cause, jig.jig == "J11"   ? TrendCause::jig
                         : jig.jig == "J42" ? TrendCause::face
                                            : TrendCause::unit)
        << jig.jig;
  }
}

// The oracle is the test's own definition: with level jigs the chance must be uniform.
TEST(GapTrends, TheCheckByRandomSignsIsRarelyAlarmed) {
  int alarms = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Random random(100 + seed, 1);
    MadeBench bench;
    bench.jigs = made_jigs(1);
    bench.units = 10;
    alarms += find_trends(made_runs(bench, random).runs).jigs.front().chance < 0.04 ? 1 : 0;
  }
  EXPECT_LE(alarms, 10) << "four in a hundred are expected";
}

TEST(GapTrends, LotsAreReadFromATable) {
  const auto lots = parse_lots("lot,serial\n2013-11,A\n2013-12,B\n2013-11,A\n", "lots.csv");
  ASSERT_OK(lots);
  EXPECT_EQ(*lots, (LotOfSerial{{"A", "2013-11"}, {"B", "2013-12"}}));
  const auto two = parse_lots("lot,serial\n1,A\n2,A\n", "lots.csv");
  EXPECT_FAILS(two, ErrorCode::bad_data);
  EXPECT_EQ(two.error().where, "lots.csv:3");
  for (const char* bad : {"", "serial\nA\n", "lot,serial\n,A\n", "lot,serial\n1,\n"}) {
    EXPECT_FAILS(parse_lots(bad, "lots.csv"), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::station
