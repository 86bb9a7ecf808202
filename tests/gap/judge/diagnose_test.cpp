#include "gap/judge/diagnose.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/explain/catalogue.h"
#include "gap/explain/scatter.h"
#include "gap/made_bundle.h"
#include "gap/simulated_bundle.h"
#include "sanitized.h"

namespace sixpoint::gap {
namespace {

const NamedValue* parameter_of(const Diagnosis& d, const std::string& effect,
                               const std::string& name) {
  for (const EffectFinding& e : d.effects) {
    for (const NamedValue& p : e.parameters) {
      if (e.name == effect && p.name == name) {
        return &p;
      }
    }
  }
  return nullptr;
}

// Oracle: the Allan deviation of a density h / f is the root of 2 ln 2 h.
TEST(Diagnose, FlickerHasASizeBetweenThoseThatAreTriedAndItsFloor) {
  const auto bundle =
      tests::simulated({{"schema", "sixpoint/scenario/1"},
                        {"seed", 1},
                        {"protocol", "production"},
                        {"effects", {{{"name", "flicker"}, {"parameters", {{"mg", 1.0}}}}}}});
  ASSERT_OK(bundle);
  const auto found = diagnose(*bundle, {});
  ASSERT_OK(found);
  const NamedValue* size = parameter_of(*found, "flicker", "mg");
  const NamedValue* floor = parameter_of(*found, "flicker", "floor_mg");
  ASSERT_NE(size, nullptr);
  ASSERT_NE(floor, nullptr);
  EXPECT_NEAR(size->value[0], 1, 2 * size->sd[0]);
  for (const double tried : sizes_of(Scatter::flicker)) {
    EXPECT_GT(std::abs(size->value[0] - tried), 0.01);
  }
  EXPECT_NEAR(floor->value[0] / size->value[0], 1.17741, 1e-5);
  const auto scenario = augmented_scenario(*found);
  EXPECT_TRUE(scenario["effects"][0]["parameters"].contains("mg"));
  EXPECT_FALSE(scenario["effects"][0]["parameters"].contains("floor_mg"));
}

// Oracle: the sizes that the simulator is told. Both act before the gain of the mode and the clock.
TEST(Diagnose, WhatActsBeforeAWrongModeAndAClockHasTheSizeItHadThere) {
  constexpr double kGain = 0.75;
  const nlohmann::json effects = {
      {{"name", "filter_mismatch"},
       {"parameters", {{"gain", kGain}, {"offset_g", {0.12, -0.15, 0.1}}}}},
      {{"name", "clock_error"}, {"parameters", {{"ppm", 3000}}}},
      {{"name", "settling"}, {"parameters", {{"amplitude", 0.04}}}},
      {{"name", "floor_vibration"},
       {"parameters", {{"vector_mg", {3, -2, 4}}, {"frequency_hz", 21.3}}}}};
  const auto bundle = tests::simulated({{"schema", "sixpoint/scenario/1"},
                                        {"seed", 8},
                                        {"protocol", "production"},
                                        {"effects", effects}});
  ASSERT_OK(bundle);
  const auto found = diagnose(*bundle, {});
  ASSERT_OK(found);
  const NamedValue* ringing = parameter_of(*found, "settling", "amplitude");
  ASSERT_NE(ringing, nullptr) << found->brief();
  EXPECT_NEAR(ringing->value[0], 0.04, 0.05 * 0.04);
  const NamedValue* line = parameter_of(*found, "floor_vibration", "vector_mg");
  ASSERT_NE(line, nullptr) << found->brief();
  const double size_mg = std::hypot(line->value[0], line->value[1], line->value[2]);
  EXPECT_NEAR(size_mg, std::sqrt(29.0), 0.05 * std::sqrt(29.0));
  const NamedValue* frequency = parameter_of(*found, "floor_vibration", "frequency_hz");
  ASSERT_NE(frequency, nullptr) << found->brief();
  EXPECT_NEAR(frequency->value[0], 21.3, 2 * frequency->sd[0]) << "the unit's clock has 21.236 Hz";
}

// Oracle: as above. A walk may be larger than realistic ones are.
TEST(Diagnose, AWalkBeyondTheRealisticOnesHasItsSize) {
  const auto bundle = tests::simulated(
      {{"schema", "sixpoint/scenario/1"},
       {"seed", 3},
       {"protocol", "production"},
       {"effects", {{{"name", "random_walk"}, {"parameters", {{"mg_per_sqrt_s", 0.9}}}}}}});
  ASSERT_OK(bundle);
  const auto found = diagnose(*bundle, {});
  ASSERT_OK(found);
  const NamedValue* size = parameter_of(*found, "random_walk", "mg_per_sqrt_s");
  ASSERT_NE(size, nullptr) << found->brief();
  EXPECT_NEAR(size->value[0], 0.9, 3 * size->sd[0]);
}

TEST(Diagnose, NothingMissingNoAlarm) {
  for (unsigned seed = 1; seed <= (tests::kSanitized ? 3U : 12U); ++seed) {
    tests::MadeUnit unit;
    unit.seed = seed;
    const auto d = diagnose(tests::made_production(unit));
    ASSERT_OK(d);
    EXPECT_EQ(d->verdict, Verdict::no_gap) << seed << ": " << d->brief();
    EXPECT_TRUE(d->effects.empty());
    EXPECT_FALSE(d->unknown.present);
    EXPECT_LT(d->gap.before_mg, 0.35);
  }
}

// What each half of the poses predicts of the other: a line that only half of them have is none of
// the catalogue's, and is not passed over.
TEST(Diagnose, ALineInHalfOfThePosesIsUnknown) {
  for (const double mg : {1.0, 3.0}) {
    const auto d = diagnose(tests::made_production({}, [&](const Segment& s, double t) {
      const double line_g = s.pose % 2 == 0 ? 1e-3 * mg * std::cos(2 * M_PI * 17.3 * t) : 0;
      return Eigen::Vector3d(s.rotation.col(2) + line_g * Eigen::Vector3d(0.6, 0, 0.8));
    }));
    ASSERT_OK(d);
    EXPECT_TRUE(d->effects.empty()) << mg << ": " << d->brief();
    EXPECT_TRUE(d->unknown.present) << mg << ": " << d->brief();
  }
}

TEST(Diagnose, MisalignmentIsNamedAndMeasured) {
  const Eigen::Vector3d turn_deg(0.3, -0.2, 0.4);
  const auto bundle = tests::made_production({}, [&](const Segment& s, double) {
    const Eigen::Vector3d r = turn_deg * M_PI / 180;
    return Eigen::Vector3d(Eigen::AngleAxisd(r.norm(), r.normalized()) * s.rotation.col(2));
  });
  const auto d = diagnose(bundle);
  ASSERT_OK(d);
  EXPECT_EQ(d->verdict, Verdict::explained);
  ASSERT_FALSE(d->effects.empty());
  EXPECT_EQ(d->effects.front().name, "misalignment");
  EXPECT_GT(d->effects.front().held_out_gain_nats, 10);
  EXPECT_GT(d->gap.closed_fraction, 0.9);
  const NamedValue* p = parameter_of(*d, "misalignment", "rotation_vector_deg");
  ASSERT_NE(p, nullptr);
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(p->value[a], turn_deg[static_cast<Eigen::Index>(a)], 4 * p->sd[a] + 0.005);
  }
  // With the true effect out of the catalogue the answer stays honest.
  DiagnoseOptions strip;
  strip.without = {"misalignment"};
  const auto honest = diagnose(bundle, strip);
  ASSERT_OK(honest);
  EXPECT_TRUE(honest->unknown.present) << honest->brief();
  for (const EffectFinding& e : honest->effects) {
    EXPECT_NE(e.name, "misalignment");
  }
}

// Six faces do not tell a tilt about the laboratory's x from a turn of the unit and cross-axis terms
// along (1, 1, 1): a foreign generator's unit, of which the answer was off by eight standard
// uncertainties. What is open is said, and which segment closes it.
TEST(Diagnose, WhatSixFacesLeaveOpenIsSaid) {
  const Eigen::Vector3d turn_deg(0.0989, 0.1515, 0.1173);
  const Eigen::Vector3d cross(-0.00364, 0.00459, -0.00540);  // yz, xz, xy
  const Eigen::Vector3d tilt_deg(-0.183, -0.232, 0);
  const auto turned = [](const Eigen::Vector3d& vector_deg) {
    const Eigen::Vector3d r = vector_deg * M_PI / 180;
    return Eigen::AngleAxisd(r.norm(), r.normalized()).toRotationMatrix();
  };
  Eigen::Matrix3d axes;
  axes << 1, cross[2], cross[1], cross[2], 1, cross[0], cross[1], cross[0], 1;
  tests::MadeUnit unit;
  unit.yaws = 1;
  const auto d = diagnose(tests::made_production(unit, [&](const Segment& s, double) {
    return Eigen::Vector3d(axes * turned(turn_deg) * s.rotation * turned(tilt_deg).col(2));
  }));
  ASSERT_OK(d);
  EXPECT_FALSE(d->unknown.present) << d->brief();
  EXPECT_THAT(
      d->brief(),
      testing::HasSubstr("(how much each of misalignment, non_orthogonality, tilt has is open)"));
  const struct {
    const char* effect;
    const char* parameter;
    Eigen::Vector3d truth;
    double open;  // of its standard uncertainty, at least
  } kRows[] = {{"misalignment", "rotation_vector_deg", turn_deg, 0.05},
               {"non_orthogonality", "yz_xz_xy", cross, 0.001},
               {"tilt", "rotation_vector_deg", tilt_deg, 0.1}};
  for (const auto& row : kRows) {
    const NamedValue* p = parameter_of(*d, row.effect, row.parameter);
    ASSERT_NE(p, nullptr) << row.effect << ": " << d->brief();
    EXPECT_GT(p->sd[0], row.open) << row.effect;
    for (std::size_t a = 0; a < 2; ++a) {
      EXPECT_NEAR(p->value[a], row.truth[static_cast<Eigen::Index>(a)], 2 * p->sd[a]) << row.effect;
    }
  }
  for (const EffectFinding& e : d->effects) {
    EXPECT_EQ(e.confounded_with.size(), 2U) << e.name;
  }
  ASSERT_FALSE(d->next_segments.empty());
  EXPECT_EQ(d->next_segments.front().name, "half_turn");
  EXPECT_THAT(d->next_segments.front().separates, testing::Contains("misalignment/tilt"));
  for (const NextSegment& next : d->next_segments) {
    EXPECT_TRUE(next.name != "faces" ||
                std::ranges::count(next.separates, "misalignment/tilt") == 0)
        << "the same faces once more";
  }
}

TEST(Diagnose, DocumentHasEveryKey) {
  const auto d = diagnose(tests::made_production({}));
  ASSERT_OK(d);
  const auto json = d->to_json();
  for (const char* key : {"verdict", "effects", "candidates", "unknown", "not_observable", "gap",
                          "where", "next_segments", "augmented_scenario", "seconds"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["candidates"].size(), catalogue().size());
  EXPECT_EQ(json["gap"]["after"]["interval_mg"].size(), 2U);
  for (const char* key : {"mean", "tone", "spectrum", "codes", "timing"}) {
    EXPECT_TRUE(json["gap"]["by_feature"].contains(key)) << key;
  }
  bool gravity = false;
  bool floor = false;
  for (const auto& entry : json["not_observable"]) {
    gravity = gravity || entry["name"] == "local_gravity";
    floor = floor || entry["name"] == "rounding_floor";
  }
  EXPECT_TRUE(gravity) << "not separable from gain without a shaker";
  EXPECT_TRUE(floor) << "never separable from offset";
}

TEST(Diagnose, UnknownNameInWithoutIsUsage) {
  DiagnoseOptions options;
  options.without = {"gremlins"};
  const auto refused = diagnose(tests::made_production({}), options);
  EXPECT_FAILS(refused, ErrorCode::usage);
  EXPECT_NE(refused.error().hint.find("misalignment, "), std::string::npos)
      << "the names there are";
}

TEST(Diagnose, RecordingsThatSayNothingAreInconclusive) {
  Bundle constant = tests::made_production({});
  std::fill(constant.samples.begin(), constant.samples.end(), gt3x::Counts{1, 2, 256});
  Bundle clipped = tests::made_production({});
  std::fill(clipped.samples.begin(), clipped.samples.end(), gt3x::Counts{2047, 2047, 2047});
  Bundle zeros = tests::made_production({});
  std::fill(zeros.samples.begin(), zeros.samples.end(), gt3x::Counts{});
  for (const Bundle* bundle : {&constant, &clipped, &zeros}) {
    const auto d = diagnose(*bundle);
    ASSERT_OK(d);
    EXPECT_FALSE(d->usable());
    EXPECT_NE(d->verdict, Verdict::no_gap);
    EXPECT_NE(d->verdict, Verdict::explained);
  }
}

// Two poses fit any gains and offsets: the answer is that of every recording that says too little.
TEST(Diagnose, TwoPosesAreInconclusive) {
  Bundle two = tests::made_production({.rounds = 2});
  std::erase_if(two.segments, [](const Segment& segment) { return segment.pose > 1; });
  const auto d = diagnose(two);
  ASSERT_OK(d);
  EXPECT_FALSE(d->usable());
  EXPECT_EQ(d->verdict, Verdict::unexplained);
  EXPECT_EQ(d->unknown.probability, 0.5);
  EXPECT_EQ(d->losses.back(),
            "2 poses only: gains and offsets of the unit can't be told from effects");
  EXPECT_EQ(std::ranges::count(d->losses, d->losses.back()), 1);
}

// A unit that lies upside down in its only pose: many turns of the axes fit alike, none is named.
TEST(Diagnose, OnePoseUpsideDownIsNoRotationOfAxes) {
  Bundle one = tests::made_production({.long_samples = 6000});
  one.segments = {one.segments.back()};
  one.segments[0].rotation = -one.segments[0].rotation;
  one.segments[0].rotation.col(1) *= -1;
  const auto d = diagnose(one);
  ASSERT_OK(d);
  for (const EffectFinding& effect : d->effects) {
    EXPECT_NE(effect.name, "axis_rotation") << d->brief();
  }
  ASSERT_TRUE(d->unknown.present);
  EXPECT_EQ(d->unknown.why.front(),
            "pose: the recording's axes do not follow the protocol's poses");
}

// Oracle: the same recording by another clock. Times count from power-on, and a host's clock may
// begin where it likes.
TEST(Diagnose, TimesBeforePowerOnLeaveTheAnswer) {
  const auto tilted = [](double shift_s) {
    const Eigen::AngleAxisd tilt(0.36 * M_PI / 180, Eigen::Vector3d::UnitX());
    Bundle bundle = tests::made_production({}, [&](const Segment& s, double) {
      return Eigen::Vector3d(s.rotation * (tilt * Eigen::Vector3d::UnitZ()));
    });
    for (Segment& segment : bundle.segments) {
      segment.host_start_s += shift_s;
    }
    for (auto* times_s : {&bundle.host_clock.host_time_s, &bundle.temperature.host_time_s}) {
      for (double& time_s : *times_s) {
        time_s += shift_s;
      }
    }
    return bundle;
  };
  for (const double shift_s : {0.0, -12'000.0, -1e6}) {
    const auto d = diagnose(tilted(shift_s));
    ASSERT_OK(d);
    EXPECT_TRUE(d->usable()) << d->brief();
    EXPECT_NE(d->verdict, Verdict::no_gap) << shift_s;
    const NamedValue* tilt = parameter_of(*d, "tilt", "rotation_vector_deg");
    ASSERT_NE(tilt, nullptr) << shift_s << ": " << d->brief();
    EXPECT_NEAR(std::abs(tilt->value[0]), 0.36, 0.03);
    EXPECT_GT(d->gap.before_mg, 1);
  }
}

// gap.after counts named effects only: lost samples that nobody names stay in it.
TEST(Diagnose, WhatIsWithheldStaysInTheGap) {
  const auto bundle = tests::simulated(
      {{"schema", "sixpoint/scenario/1"},
       {"seed", 5},
       {"protocol", "production"},
       {"rate_hz", 50},
       {"effects",
        {{{"name", "tilt"}, {"parameters", {{"rotation_vector_deg", {0.3, 0.2, 0}}}}},
         {{"name", "dropped_samples"}, {"parameters", {{"rate", 0.005}}}}}}});
  ASSERT_OK(bundle);
  const auto all = diagnose(*bundle, {});
  ASSERT_OK(all);
  const auto part = diagnose(*bundle, {.without = {"dropped_samples"}});
  ASSERT_OK(part);
  EXPECT_EQ(part->verdict, Verdict::partly_explained) << part->brief();
  const double lost_mg2 = 0.005 * 1e6;  // 1 g rms for each, by convention
  EXPECT_NEAR(part->gap.after_mg, std::sqrt(lost_mg2), 0.3 * std::sqrt(lost_mg2));
  EXPECT_NEAR(part->unknown.size_mg, part->gap.after_mg, 0.1);
  EXPECT_LT(part->gap.closed_fraction, 0.1);
  for (const EffectFinding& effect : part->effects) {
    EXPECT_LT(effect.share_of_gap, 0.1) << effect.name;
  }
  EXPECT_GT(all->gap.closed_fraction, 0.9);
}

TEST(Diagnose, NoTemperatureAndNoHostClockAreBorne) {
  Bundle bundle = tests::made_production({});
  bundle.temperature = {};
  bundle.host_clock = {};
  const auto d = diagnose(bundle);
  ASSERT_OK(d);
  EXPECT_EQ(d->verdict, Verdict::no_gap) << d->brief();
  bool clock = false;
  for (const auto& [name, segment] : d->not_observable) {
    clock = clock || name == "clock_error";
  }
  EXPECT_TRUE(clock);
}

// 6 g at 19.3 Hz, by hand: the scatter of sample times shows on its slopes, between samples that are
// lost, too. Where the phase steps by half a sample there is no one tone.
TEST(Diagnose, JitterIsNotShownWhereNoToneIsWhole) {
  for (const double slip : {0.0, 1.0, 0.5}) {
    Bundle bundle = tests::made_production({});
    Segment tone;
    tone.name = "shaker_high";
    tone.kind = Segment::Kind::vibration;
    tone.first_sample = bundle.samples.size();
    tone.samples = 1000;
    tone.host_start_s = bundle.segments.back().host_start_s + 16;
    tone.placement = 99;
    tone.vibration = Vibration{Eigen::Vector3d::UnitZ(), 19.3, 6};
    std::mt19937_64 random(2);
    std::normal_distribution<double> noise_lsb(0, 1);
    for (std::size_t n = 0; n < tone.samples; ++n) {
      const double at = static_cast<double>(n) + (n >= 600 ? slip : 0);
      const double z = 1 + 6 * std::cos(2 * M_PI * 0.193 * at);
      gt3x::Counts counts{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        counts[axis] =
            static_cast<std::int16_t>(std::lround(noise_lsb(random) + (axis == 2 ? 256 * z : 0)));
      }
      bundle.samples.push_back(counts);
      if (n % 100 == 0) {
        bundle.host_clock.sample_index.push_back(tone.first_sample + n);
        bundle.host_clock.host_time_s.push_back(tone.host_start_s + at / 100);
      }
    }
    bundle.segments.push_back(tone);
    const auto d = diagnose(bundle);
    ASSERT_OK(d);
    EXPECT_EQ(std::ranges::count(d->not_observable,
                                 std::pair<std::string, std::string>("jitter", "shaker_high")),
              slip == 0.5 ? 1 : 0)
        << slip << " samples: " << d->brief();
  }
}

// A zero that moves once is in no catalogue. It must not be named random walk, drift or warming up.
TEST(Diagnose, AZeroThatMovedOnceIsUnknown) {
  for (const double step_mg : {3.0, 8.0}) {
    const Bundle bundle = tests::made_production({}, [&](const Segment& segment, double) {
      const Eigen::Vector3d moved = Eigen::Vector3d(1, -0.4, 0.7) * step_mg / 1000;
      return Eigen::Vector3d(segment.rotation.col(2) +
                             (segment.placement >= 8 ? moved : Eigen::Vector3d::Zero()));
    });
    const auto d = diagnose(bundle);
    ASSERT_OK(d);
    EXPECT_TRUE(d->unknown.present) << step_mg << ": " << d->brief();
  }
}

bool names(const Diagnosis& d, const std::string& effect) {
  return std::any_of(d.effects.begin(), d.effects.end(),
                     [&](const EffectFinding& e) { return e.name == effect; });
}

// A walk of the sensor is about alike in all axes; a supply that couples into one is in no
// catalogue.
TEST(Diagnose, AZeroThatSwingsOnOneAxisIsNoRandomWalk) {
  for (const double period_s : {60.0, 120.0}) {
    const Bundle bundle = tests::made_production({}, [&](const Segment& segment, double t_s) {
      const double angle = 2 * M_PI * (segment.host_start_s + t_s) / period_s;
      return Eigen::Vector3d(segment.rotation.col(2) +
                             Eigen::Vector3d(0.005 * std::sin(angle), 0, 0));
    });
    const auto d = diagnose(bundle);
    ASSERT_OK(d);
    EXPECT_TRUE(d->unknown.present) << period_s << ": " << d->brief();
    EXPECT_FALSE(names(*d, "random_walk")) << period_s << ": " << d->brief();
  }
}

// A zero that wanders off: three minutes show that it does, and hardly whether it drifts on or
// warms up. The likelier one is named with the other beside it, and nothing is unknown.
TEST(Diagnose, OfTwoThatLookAlikeTheLikelierIsNamed) {
  constexpr double kDrift_mg_per_h = 12;
  const auto d = diagnose(tests::made_production({}, [](const Segment& segment, double t) {
    const double hours = (segment.host_start_s + t) / 3600;
    return Eigen::Vector3d(segment.rotation.col(2) +
                           Eigen::Vector3d(0.6, -0.5, 0.62) * (kDrift_mg_per_h / 1000 * hours));
  }));
  ASSERT_OK(d);
  EXPECT_FALSE(d->unknown.present) << d->brief();
  ASSERT_EQ(d->effects.size(), 1U) << d->brief();
  EXPECT_EQ(d->effects[0].name, "drift");
  EXPECT_EQ(d->effects[0].confounded_with, std::vector<std::string>{"warm_up"});
  EXPECT_LT(d->effects[0].probability, 0.9);
}

// A parameter that does not hold throughout is no effect of the catalogue: the same skew is named
// while it stands still.
TEST(Diagnose, ATiltThatGrowsIsNotATilt) {
  const auto tilted = [](const auto& size_deg) {
    return tests::made_production({}, [&](const Segment& segment, double) {
      const double angle = size_deg(segment.placement) * M_PI / 180;
      return Eigen::Vector3d(segment.rotation *
                             Eigen::AngleAxisd(angle, Eigen::Vector3d(0.6, 0.8, 0)) *
                             Eigen::Vector3d::UnitZ());
    });
  };
  const auto fixed = diagnose(tilted([](int) { return 0.2; }));
  ASSERT_OK(fixed);
  EXPECT_TRUE(names(*fixed, "tilt")) << fixed->brief();
  EXPECT_FALSE(fixed->unknown.present) << fixed->brief();
  const auto growing = diagnose(tilted([](int placement) { return 0.4 * placement / 18; }));
  ASSERT_OK(growing);
  EXPECT_TRUE(growing->unknown.present) << growing->brief();
}

// The zero falls short on the side from which the pose was approached, and only across: no
// hysteresis of an axis, and no walk either.
TEST(Diagnose, WhatGoesWithTheApproachIsNoRandomWalk) {
  const auto bundle = tests::made_production({}, [](const Segment& segment, double) {
    const Eigen::Vector3d& from = segment.approach_g;
    return Eigen::Vector3d(segment.rotation.col(2) +
                           0.004 * Eigen::Vector3d(from[1], from[2], from[0]));
  });
  DiagnoseOptions options;
  options.without = {"hysteresis"};
  const auto d = diagnose(bundle, options);
  ASSERT_OK(d);
  EXPECT_TRUE(d->unknown.present) << d->brief();
}

TEST(Diagnose, OneAxisGoneAstrayIsNoFilterMismatch) {
  tests::MadeUnit mode;
  mode.gain = {0.88, 0.87, 0.89};
  mode.offset_g = {0.12, -0.16, 0.1};
  const auto mismatch = diagnose(tests::made_production(mode));
  ASSERT_OK(mismatch);
  EXPECT_TRUE(names(*mismatch, "filter_mismatch")) << mismatch->brief();
  EXPECT_FALSE(mismatch->unknown.present) << mismatch->brief();
  tests::MadeUnit broken;
  broken.gain[1] = 0.75;
  const auto d = diagnose(tests::made_production(broken));
  ASSERT_OK(d);
  EXPECT_FALSE(names(*d, "filter_mismatch")) << d->brief();
  EXPECT_TRUE(d->unknown.present) << d->brief();
}

// A gain that jumps once while the temperature changes bends over it more than a tempco does.
TEST(Diagnose, AGainThatJumpsIsUnknown) {
  for (const std::size_t axis : {0U, 2U}) {
    auto bundle = tests::simulated(
        {{"schema", "sixpoint/scenario/1"}, {"seed", 5}, {"protocol", "engineering"}});
    ASSERT_OK(bundle);
    for (std::size_t i = bundle->samples.size() * 2 / 5; i < bundle->samples.size(); ++i) {
      std::int16_t& count = bundle->samples[i][axis];
      count = static_cast<std::int16_t>(count + std::lround(count / 256.0));
    }
    const auto d = diagnose(*bundle);
    ASSERT_OK(d);
    EXPECT_TRUE(d->unknown.present) << d->brief();
    for (const EffectFinding& effect : d->effects) {
      EXPECT_LT(effect.probability, 0.5) << d->brief();
    }
  }
}

// One long record shows a small line and not its frame; that is told by the phase that the line
// keeps from dwell to dwell. It is no line of some poses only.
TEST(SimulatedLine, ThatOneLongRecordShowsIsNamedByItsPhase) {
  const auto bundle = tests::simulated(
      {{"schema", "sixpoint/scenario/1"},
       {"seed", 4},
       {"protocol", "engineering"},
       {"effects",
        {{{"name", "floor_vibration"},
          {"parameters", {{"vector_mg", {0.085, -0.1, 0.08}}, {"frequency_hz", 23.9}}}}}}});
  ASSERT_OK(bundle);
  const auto d = diagnose(*bundle);
  ASSERT_OK(d);
  EXPECT_FALSE(d->unknown.present) << d->brief();
  ASSERT_EQ(d->effects.size(), 1U) << d->brief();
  EXPECT_EQ(d->effects[0].name, "floor_vibration");
  EXPECT_GT(d->effects[0].probability, 0.9);
  EXPECT_TRUE(d->effects[0].confounded_with.empty());
}

struct EffectsCase {
  const char* effects;
  unsigned seed;
};

class SimulatedUnit : public ::testing::TestWithParam<EffectsCase> {};

// All that is there is named, and nothing else: effects that bear on one another. Oracle: sim/.
TEST_P(SimulatedUnit, IsNamedWholly) {
  const auto effects = nlohmann::ordered_json::parse(GetParam().effects);
  const auto bundle = tests::simulated({{"schema", "sixpoint/scenario/1"},
                                        {"seed", GetParam().seed},
                                        {"protocol", "engineering"},
                                        {"effects", effects}});
  ASSERT_OK(bundle);
  const auto d = diagnose(*bundle);
  ASSERT_OK(d);
  std::set<std::string> there;
  for (const auto& effect : effects) {
    there.insert(effect["name"]);
  }
  std::set<std::string> named;
  for (const EffectFinding& effect : d->effects) {
    named.insert(effect.name);
  }
  EXPECT_EQ(named, there) << d->brief();
  EXPECT_FALSE(d->unknown.present) << d->brief();
}

INSTANTIATE_TEST_SUITE_P(
    Effects, SimulatedUnit,
    ::testing::Values(
        // A tone at the corner: of the grid's corners a wrong form is nearer.
        EffectsCase{R"([{"name": "bandwidth", "parameters": {"corner_hz": 40, "order": 6}}])", 5},
        // The tone of 6 g is clipped to one sample of five, or two.
        EffectsCase{R"([{"name": "soft_mount", "parameters": {"frequency_hz": 22.33, "q": 3.3}}])",
                    13},
        EffectsCase{R"([{"name": "saturation", "parameters": {"level_g": 4}}])", 13},
        // Of the oblique poses some are reached by a step too small to turn it.
        EffectsCase{R"([{"name": "hysteresis", "parameters": {"mg": [-1, -1.1, 1.84]}}])", 2},
        EffectsCase{R"([{"name": "hysteresis", "parameters": {"mg": [-1, -1.1, 1.84]}}])", 3},
        // The curve is before the filter.
        EffectsCase{R"([{"name": "third_order", "parameters": {"mg_per_g3": [0.03, -0.02, 0.01]}},
                        {"name": "bandwidth", "parameters": {"corner_hz": 18, "order": 2}}])",
                    3},
        EffectsCase{R"([{"name": "second_order", "parameters": {"mg_per_g2": [0.3, -0.2, 0.25]}},
                        {"name": "bandwidth", "parameters": {"corner_hz": 18, "order": 2}}])",
                    4},
        // One long record shows the harmonic: its frame is that of the line it belongs to.
        EffectsCase{R"([{"name": "floor_vibration",
                         "parameters": {"vector_mg": [0.4, -0.3, 0.45], "frequency_hz": 11.7}},
                        {"name": "floor_vibration",
                         "parameters": {"vector_mg": [0.08, -0.06, 0.09], "frequency_hz": 23.4}}])",
                    3},
        // Times that scatter bring the tone of 11 g off by 350 counts.
        EffectsCase{R"([{"name": "wrap"}, {"name": "jitter", "parameters": {"rms_ms": 1.45}}])",
                    7}));

}  // namespace
}  // namespace sixpoint::gap
