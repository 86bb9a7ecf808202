#include "station/jig_session.h"

#include <cmath>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "expect_result.h"
#include "mocks/in_process.h"
#include "mocks/inert.h"
#include "mocks/virtual_jig.h"
#include "station/capture_run.h"

namespace sixpoint::station {
namespace {

using calib::FilterConfiguration;
using mocks::PluggedUnit;
using mocks::VirtualJig;
using testing::Contains;
using testing::HasSubstr;

struct Bench {
  explicit Bench(std::uint64_t seed = 7, const sim::UnitWishes& wishes = {}) {
    mocks::VirtualUnitOptions options;
    options.seed = seed;
    options.truth = sim::draw_unit(seed, wishes);
    clock = std::make_shared<ManualClock>();
    plugged = std::make_shared<PluggedUnit>(options, clock);
    jig = std::make_unique<VirtualJig>(plugged);
    unit = *device::Unit::open(mocks::link_to(plugged, false));
  }
  Result<JigReport> run(JigSessionOptions options = {}) {
    auto report = run_jig(*unit, *jig, env.env, options, [this](const JigAction& action) {
      log.push_back(action);
      if (on_action) {
        on_action(action);
      }
    });
    for (const std::string& code : report ? report->codes : std::vector<std::string>{}) {
      EXPECT_NE(find_failure_code(code), nullptr) << code << " is not in the catalogue";
    }
    return report;
  }
  MemoryEnv env;
  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<PluggedUnit> plugged;
  std::unique_ptr<VirtualJig> jig;
  std::unique_ptr<device::Unit> unit;
  std::function<void(const JigAction&)> on_action;
  std::vector<JigAction> log;
};

// Oracle: the virtual unit's truth. 0.1 % of sensitivity is 1 mg, 0.3 LSB of zero too: noise of a
// dwell is 0.2 mg, seating 0.17.
TEST(JigSession, FindsTheSensorUnderCurrent) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Bench bench(seed);
    const auto report = bench.run();
    ASSERT_OK(report);
    EXPECT_EQ(report->verdict, JigVerdict::pass) << report->brief();
    const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
    ASSERT_TRUE(report->six);
    const calib::Calibration& found = report->six->best().calibration;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      EXPECT_NEAR(found.sensitivity_g_per_lsb[axis] * truth.sensitivity_lsb_per_g[axis], 1, 1e-3);
      EXPECT_NEAR(found.zero_lsb[axis], truth.zero_lsb[axis], 0.3);
    }
    EXPECT_LT(report->verification.worst_mg, 2);
    EXPECT_GT(report->as_found_residual_mg, 50) << "the constants of `legacy` do not fit";
    EXPECT_FALSE(report->written);
    EXPECT_EQ(report->as_left->constants, report->as_found->constants);
    EXPECT_EQ(report->record().filter, FilterConfiguration::current);
    EXPECT_GT(report->raw_csv.size(), 100'000U) << "raw data kept";
  }
}

TEST(JigSession, ATiltedPlacementIsAskedForAgain) {
  Bench bench;
  int places = 0;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::place && ++places == 3) {
      bench.jig->tilt_next(7.2);
    }
  };
  const auto report = bench.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass);
  EXPECT_EQ(report->refusals, 1);
  bool told = false;
  for (const JigAction& action : bench.log) {
    told = told || (action.kind == JigAction::Kind::refused && action.text.starts_with("tilted "));
  }
  EXPECT_TRUE(told);
}

TEST(JigSession, WritesReadsBackAndMeasuresAgain) {
  Bench bench;
  JigSessionOptions options;
  options.run.write = true;
  const auto report = bench.run(options);
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass) << report->brief();
  EXPECT_TRUE(report->written);
  const auto page = bench.unit->read_calibration();
  ASSERT_OK(page);
  EXPECT_EQ(page->constants, report->six->best().stored);
  EXPECT_EQ(report->as_left->constants, page->constants);
  EXPECT_EQ(report->recheck.poses.size(), 2U);
  EXPECT_LT(report->recheck.worst_mg, 4) << "half a count of each is 2 mg";
  // The new date makes every firmware choose `current`, for which these constants hold.
  EXPECT_EQ(bench.unit->filter()->recording, FilterConfiguration::current);
}

TEST(JigSession, AWriteThatTheUnitRefusesIsAFailWithTheOldConstants) {
  Bench bench;
  JigSessionOptions options;
  options.run.write = true;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::write) {
      bench.plugged->unit.set_battery_mv(3000);
    }
  };
  const auto report = bench.run(options);
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::fail);
  EXPECT_FALSE(report->written);
  EXPECT_THAT(report->reasons, Contains(HasSubstr("battery low")));
  EXPECT_EQ(bench.unit->read_calibration()->constants, report->as_found->constants);
}

// The sensor's second order is beyond six constants; the verdict must notice a unit that is bad.
TEST(JigSession, AnImpossibleFilterIsRefused) {
  Bench bench;
  JigSessionOptions options;
  options.filter = FilterConfiguration::legacy;
  EXPECT_FAILS(bench.run(options), ErrorCode::usage);
  options.filter = FilterConfiguration::current;
  options.run.write = true;
  options.filter = FilterConfiguration::legacy;
  EXPECT_FAILS(bench.run(options), ErrorCode::usage);

  // A unit of 2018 has one configuration only; asking for the other is the operator's business.
  sim::UnitWishes wishes;
  wishes.calibrated = *parse_iso8601("2018-05-01");
  Bench later(7, wishes);
  const auto report = later.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass);
}

TEST(JigSession, UnpluggingEndsTheRun) {
  Bench bench;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::accepted) {
      bench.plugged->unplugged = true;
    }
  };
  EXPECT_FAILS(bench.run(), ErrorCode::device_unavailable);
}

TEST(JigSession, ASilentStreamEndsTheRun) {
  Bench bench;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::accepted) {
      bench.plugged->unit.cut_power(bench.clock->elapsed());
    }
  };
  EXPECT_FAILS(bench.run(), ErrorCode::device_unavailable);
}

TEST(JigSession, AJigThatDoesNotTurnIsInconclusive) {
  Bench bench;
  mocks::InertJig still;
  const auto report = run_jig(*bench.unit, still, bench.env.env, {}, {});
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::inconclusive);
  EXPECT_FALSE(report->usable());
  EXPECT_FALSE(still.poses.empty());
}

TEST(JigSession, LossesAreSeenAndDoNotSpoilTheConstants) {
  Bench bench;
  device::Link link = mocks::link_to(bench.plugged, false);
  int reports = 0;
  link.reports = std::make_unique<mocks::TamperingTransport>(
      std::move(link.reports), nullptr, [&](Bytes& bytes) {
        if (bytes.size() > 1 && bytes[1] != 3) {
          return 1;
        }
        ++reports;
        if (reports % 500 == 7) {
          return 0;
        }
        if (reports % 500 == 99) {
          bytes[20] ^= 0x80;
        }
        return reports % 300 == 5 ? 2 : 1;
      });
  bench.unit = *device::Unit::open(std::move(link));
  const auto report = bench.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass);
  EXPECT_GT(report->stream.lost_samples, 0U);
  EXPECT_GT(report->stream.damaged_reports, 0U);
  EXPECT_GT(report->stream.duplicate_reports, 0U);
  EXPECT_LT(report->verification.worst_mg, 2);
}

TEST(JigSession, AnUnreadablePageIsNoObstacle) {
  Bench bench;
  bench.plugged->unit.memory().corrupt(300, 1);
  const auto report = bench.run();
  // The virtual unit refuses to read a worn page at all.
  EXPECT_FAILS(report, ErrorCode::io);
}

TEST(JigReportJson, HasTheContractsKeys) {
  Bench bench;
  const auto report = bench.run();
  ASSERT_OK(report);
  const auto json = report->to_json();
  for (const char* key : {"serial", "filter", "verdict", "poses", "constants", "as_found",
                          "as_left", "verification", "uncertainty"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["poses"].size(), 6U);
  for (const char* key : {"pose", "mean_lsb", "sd_lsb", "samples", "temperature_c", "tilt_deg"}) {
    EXPECT_TRUE(json["poses"][0].contains(key)) << key;
  }
  EXPECT_TRUE(json["verification"].contains("residual_mg"));
  EXPECT_EQ(json["verification"]["poses"].size(), 8U);
}

// As a program that was killed leaves it.
TEST(JigSession, AUnitThatWasLeftStreamingIsMeasuredAllTheSame) {
  Bench bench;
  ASSERT_OK(bench.unit->start_stream(50));
  ASSERT_FALSE(bench.unit->set_filter(FilterConfiguration::legacy)) << "it is busy";
  const auto report = run_jig(*bench.unit, *bench.jig, bench.env.env, {}, {});
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass) << report->brief();
}

// --- capture ---

const SidePrompt kYes = [](device::Pose, std::size_t, std::size_t) { return true; };

// Oracle: the virtual unit's truth. Still blocks of a six-sided file: 2 mg.
TEST(Capture, RecordsDownloadsAndSolves) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Bench bench(seed);
    CaptureOptions options;
    options.output = "c.gt3x";
    const auto report = run_capture(*bench.unit, *bench.jig, bench.env.env, options, kYes);
    ASSERT_OK(report);
    ASSERT_TRUE(report->solved);
    EXPECT_TRUE(report->usable()) << report->solved->brief();
    EXPECT_EQ(report->solved->filter, FilterConfiguration::current);
    const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      EXPECT_NEAR(report->solved->calibration->sensitivity_g_per_lsb[axis] *
                      truth.sensitivity_lsb_per_g[axis],
                  1, 3e-3);
      EXPECT_NEAR(report->solved->calibration->zero_lsb[axis], truth.zero_lsb[axis], 0.8);
    }
    EXPECT_TRUE(bench.env.files.info("c.gt3x"));
  }
}

TEST(Capture, RefusesAUnitWhoseRecordingCannotHelp) {
  for (const char* firmware : {"1.2.0", "1.8.0"}) {
    sim::UnitWishes wishes;
    wishes.firmware = firmware;
    Bench bench(7, wishes);
    CaptureOptions options;
    options.output = "c.gt3x";
    const auto report = run_capture(*bench.unit, *bench.jig, bench.env.env, options, kYes);
    ASSERT_OK(report);
    EXPECT_FALSE(report->usable());
    EXPECT_THAT(report->refusal, Contains(HasSubstr("firmware from 1.4.0 to 1.7.0")));
    EXPECT_FALSE(bench.env.files.info("c.gt3x"));
    EXPECT_TRUE(bench.unit->recordings()->empty()) << "nothing was recorded";
  }
  sim::UnitWishes later;
  later.firmware = "1.8.0";
  later.calibrated = *parse_iso8601("2015-01-01");
  Bench bench(7, later);
  CaptureOptions options;
  options.output = "c.gt3x";
  EXPECT_TRUE(run_capture(*bench.unit, *bench.jig, bench.env.env, options, kYes)->usable());
}

TEST(Capture, SidesThatWereLeftOutAreNamed) {
  Bench bench;
  mocks::InertJig lazy;  // never turns it
  CaptureOptions options;
  options.output = "c.gt3x";
  const auto report = run_capture(*bench.unit, lazy, bench.env.env, options, kYes);
  ASSERT_OK(report);
  EXPECT_FALSE(report->usable());
  const auto& missing = report->solved->verification.missing_directions;
  EXPECT_THAT(missing, Contains("-z"));
  EXPECT_GE(missing.size(), 4U);
}

TEST(Capture, ThePersonMayStopAndTheUnitIsNotLeftRecording) {
  Bench bench;
  CaptureOptions options;
  options.output = "c.gt3x";
  const auto report =
      run_capture(*bench.unit, *bench.jig, bench.env.env, options,
                  [](device::Pose, std::size_t number, std::size_t) { return number < 3; });
  ASSERT_OK(report);
  EXPECT_TRUE(report->stopped);
  ASSERT_OK(bench.unit->start_stream(100));  // not busy
}

TEST(Capture, AUnitThatWasLeftStreamingRecords) {
  Bench bench;
  ASSERT_OK(bench.unit->start_stream(50));
  CaptureOptions options;
  options.output = "c.gt3x";
  const auto report = run_capture(*bench.unit, *bench.jig, bench.env.env, options, kYes);
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable());
}

TEST(Capture, DoesNotWriteOverAFile) {
  Bench bench;
  ASSERT_OK(bench.env.files.create("c.gt3x"));
  CaptureOptions options;
  options.output = "c.gt3x";
  EXPECT_FAILS(run_capture(*bench.unit, *bench.jig, bench.env.env, options, kYes),
               ErrorCode::cannot_create);
  EXPECT_TRUE(bench.unit->recordings()->empty());
}

}  // namespace
}  // namespace sixpoint::station
