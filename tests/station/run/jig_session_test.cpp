#include "station/run/jig_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "mocks/inert/inert.h"
#include "station/virtual_bench.h"

namespace sixpoint::station {
namespace {

using calib::FilterConfiguration;
using testing::Contains;
using testing::HasSubstr;

// Oracle: the virtual unit's truth. 0.1 % of sensitivity is 1 mg, 0.3 LSB of zero too: noise of a
// dwell is 0.2 mg, seating 0.17.
TEST(JigSession, OnlyAUnitThatWentAwayIsGone) {
  EXPECT_EQ(interruption(ErrorCode::device_unavailable), "unit_gone");
  EXPECT_EQ(interruption(ErrorCode::bad_data), "interrupted");
}

TEST(JigSession, FindsTheSensorUnderCurrent) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    VirtualBench bench(seed);
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
    EXPECT_GT(report->as_found_residual_mg.value_or(0), 50)
        << "the constants of `legacy` do not fit";
    EXPECT_FALSE(report->written);
    EXPECT_EQ(report->as_left->constants, report->as_found->constants);
    EXPECT_EQ(report->record().filter, FilterConfiguration::current);
    EXPECT_GT(report->raw_csv.size(), 100'000U) << "raw data kept";
  }
}

// The page knows nothing of the zeros. Oracle: the truth against docs/limits.md.
TEST(JigSession, AZeroFarFromNominalIsMeasuredAndJudged) {
  struct Row {
    PerAxis<double> lsb_per_g;
    PerAxis<double> zero_lsb;
    JigVerdict verdict;
    const char* code;
  };
  for (const Row& row :
       {Row{{250, 250, 250}, {-80, -80, -80}, JigVerdict::pass, ""},
        Row{{250, 250, 250}, {-130, 0, 0}, JigVerdict::pass, ""},
        Row{{250, 250, 250}, {150, 150, -100}, JigVerdict::pass, ""},
        Row{{250, 250, 250}, {-200, 0, 0}, JigVerdict::fail, "zero_low"},
        Row{{250, 250, 250}, {0, 0, -300}, JigVerdict::fail, "zero_low"},
        Row{{250, 250, 250}, {220, 0, 0}, JigVerdict::fail, "zero_high"},
        Row{{100, 250, 250}, {20, 20, 20}, JigVerdict::fail, "sensitivity_high"},
        Row{{250, 250, 100}, {20, 20, 20}, JigVerdict::fail, "sensitivity_high"}}) {
    sim::GivenProperties given;
    given.current_sensitivity_lsb_per_g = row.lsb_per_g;
    given.current_zero_lsb = row.zero_lsb;
    for (const bool without_zero : {false, true}) {
      given.zero_lsb = without_zero ? std::optional(PerAxis<int>{0, 0, 0}) : std::nullopt;
      VirtualBench bench(7, given);
      const auto report = bench.run();
      ASSERT_OK(report) << row.zero_lsb[0] << ' ' << row.zero_lsb[2];
      EXPECT_EQ(report->verdict, row.verdict) << report->brief();
      if (row.verdict == JigVerdict::fail) {
        EXPECT_THAT(report->codes, Contains(row.code)) << report->brief();
      }
    }
  }
}

// The unit lies in the jig as no one thinks. The jig is asked, and is not believed.
TEST(JigSession, AUnitThatWasPutInAskewIsFoundByTheSecondPlacement) {
  class AskewJig final : public device::Jig {
   public:
    explicit AskewJig(device::Jig& jig) : jig_(jig) {}
    std::string name() const override { return jig_.name(); }
    bool turns_by_itself() const override { return true; }
    Status go_to(Pose pose) override {
      said_ = pose;
      return jig_.go_to(
          device::pose_of((device::axis_of(pose) + 1) % kAxes, device::sign_of(pose)));
    }
    Result<device::JigPosition> position() override {
      SIXPOINT_ASSIGN(device::JigPosition position, jig_.position());
      position.pose = position.pose ? std::optional(said_) : std::nullopt;
      return position;
    }
    Status stop() override { return jig_.stop(); }
    Status release() override { return jig_.release(); }

   private:
    device::Jig& jig_;
    Pose said_ = Pose::plus_z;
  };
  VirtualBench bench;
  AskewJig askew(*bench.jig);
  const auto report = run_jig({bench.unit.get(), &askew}, bench.env.env, {}, {});
  EXPECT_FAILS(report, ErrorCode::bad_data);
  EXPECT_THAT(report.error().what, HasSubstr("stands at -z and the unit reads -x"));
}

TEST(JigSession, MeasuresUnderItsFilterWhateverTheUnitHad) {
  VirtualBench bench;
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::legacy));
  const auto report = bench.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass) << report->brief();
  EXPECT_EQ(report->record().filter, FilterConfiguration::current);
  EXPECT_EQ(bench.unit->filter()->stream, FilterConfiguration::current);
}

TEST(JigSession, ATiltedPlacementIsAskedForAgain) {
  VirtualBench bench;
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
  VirtualBench bench;
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
  VirtualBench bench;
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

// Its page is damaged as it was found: what it holds was read, and is as it was.
TEST(JigSession, ARefusedWriteIntoADamagedPageIsAFail) {
  VirtualBench bench;
  bench.plugged->unit.spoil_page();
  JigSessionOptions options;
  options.run.write = true;
  options.keep_interrupted = true;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::write) {
      bench.plugged->unit.set_battery_mv(3000);
    }
  };
  const auto report = bench.run(options);
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::fail) << report->brief();
  EXPECT_THAT(report->codes, testing::ElementsAre("write_refused"));
  EXPECT_FALSE(report->written);
  EXPECT_FALSE(report->write_begun);
  EXPECT_FALSE(report->as_left);
  EXPECT_THAT(report->reasons, Contains(HasSubstr("battery low")));
  EXPECT_THAT(report->reasons, testing::Not(Contains(HasSubstr("was not read"))));
}

// The sensor's second order is beyond six constants; the verdict must notice a unit that is bad.
TEST(JigSession, AnImpossibleFilterIsRefused) {
  VirtualBench bench;
  JigSessionOptions options;
  options.filter = FilterConfiguration::legacy;
  EXPECT_FAILS(bench.run(options), ErrorCode::usage);
  options.filter = FilterConfiguration::current;
  options.run.write = true;
  options.filter = FilterConfiguration::legacy;
  EXPECT_FAILS(bench.run(options), ErrorCode::usage);

  options.run.write = false;
  sim::GivenProperties given;
  for (const char* two : {"2014-03-23", "1970-01-01"}) {  // a clock that was never set
    given.calibrated = *parse_iso8601(two);
    EXPECT_FAILS(VirtualBench(7, given).run(options), ErrorCode::usage);
  }
  VirtualBench unreadable;
  unreadable.plugged->unit.spoil_page();
  EXPECT_FAILS(unreadable.run(options), ErrorCode::usage);
  given.calibrated = *parse_iso8601("2014-03-24");
  EXPECT_OK(VirtualBench(7, given).run(options));
  given.serial = "NEO1A45130007";
  given.calibrated = *parse_iso8601("2013-11-12");
  EXPECT_OK(VirtualBench(7, given).run(options));

  // A unit of 2018 has one configuration only; asking for the other is the operator's business.
  given.serial = std::nullopt;
  given.calibrated = *parse_iso8601("2018-05-01");
  VirtualBench later(7, given);
  const auto report = later.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass);
}

TEST(JigSession, UnpluggingEndsTheRun) {
  VirtualBench bench;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::accepted) {
      bench.plugged->unplugged = true;
    }
  };
  EXPECT_FAILS(bench.run(), ErrorCode::device_unavailable);
}

TEST(JigSession, ASilentStreamEndsTheRun) {
  VirtualBench bench;
  bench.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::accepted) {
      bench.plugged->unit.cut_power(bench.clock->elapsed());
    }
  };
  EXPECT_FAILS(bench.run(), ErrorCode::device_unavailable);
}

TEST(JigSession, AJigThatDoesNotTurnIsInconclusive) {
  VirtualBench bench;
  mocks::InertJig still;
  const auto report = run_jig({bench.unit.get(), &still}, bench.env.env, {}, {});
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::inconclusive);
  EXPECT_FALSE(report->usable());
  EXPECT_FALSE(still.poses.empty());
}

TEST(JigSession, LossesAreSeenAndDoNotSpoilTheConstants) {
  VirtualBench bench;
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
  bench.unit = *device::WireUnit::open(std::move(link));
  const auto report = bench.run();
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass);
  EXPECT_GT(report->stream.lost_samples, 0U);
  EXPECT_GT(report->stream.damaged_reports, 0U);
  EXPECT_GT(report->stream.duplicate_reports, 0U);
  EXPECT_LT(report->verification.worst_mg, 2);
}

TEST(JigSession, AnUnreadablePageIsNoObstacle) {
  VirtualBench bench;
  bench.plugged->unit.memory().corrupt(300, 1);
  const auto report = bench.run();
  // The virtual unit refuses to read a worn page at all.
  EXPECT_FAILS(report, ErrorCode::io);
}

// The motor of the virtual jig counts movements with hands in it. The hands come with a stop and
// no one takes them out here, so after it nothing may move.
TEST(JigSession, TheOperatorsStopStopsTheMotorFirst) {
  VirtualBench bench;
  bool asked = false;
  bool moved_after = false;
  JigHooks hooks;
  hooks.next_command = [&]() -> std::optional<OperatorCommand> {
    const bool turns = bench.plugged->unit.is_turning(bench.clock->elapsed());
    if (asked || bench.plugged->motor.movements < 3 || !turns) {
      return std::nullopt;
    }
    asked = true;
    return OperatorCommand::stop;
  };
  hooks.on_action = [&](const JigAction& action) {
    moved_after = moved_after || (action.kind == JigAction::Kind::finished &&
                                  bench.plugged->unit.is_turning(bench.clock->elapsed()));
  };
  const auto report = run_jig(bench.on_jig(), bench.env.env, {}, hooks);
  ASSERT_OK(report);
  EXPECT_TRUE(asked);
  EXPECT_EQ(report->verdict, JigVerdict::stopped);
  const auto json = report->to_json();
  EXPECT_TRUE(json["verification"]["residual_rounded_mg"].is_null()) << "nothing was measured";
  EXPECT_EQ(json["as_left"]["residual_mg"], json["as_found"]["residual_mg"]);
  EXPECT_FALSE(moved_after) << "it stands before the run says so";
  // The next run finds it held, and does not release it.
  JigSessionOptions options;
  options.keep_interrupted = true;
  const auto next = bench.run(options);
  ASSERT_OK(next);
  EXPECT_EQ(next->verdict, JigVerdict::inconclusive);
  ASSERT_TRUE(next->ended_by);
  EXPECT_THAT(next->ended_by->what, HasSubstr("emergency stop"));
  EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0);
  bench.plugged->motor.hands_out();
  ASSERT_OK(bench.jig->release());
  EXPECT_EQ(bench.run()->verdict, JigVerdict::pass);
}

struct AwayRow {
  const char* name;
  bool by_operator;  // else the jig's own button
  JigVerdict verdict;
};

// The technician stops the jig, reaches in, reseats the cable: the motor stands still.
TEST(JigSession, AStopWhileTheUnitIsAwayHoldsWhenItIsBack) {
  for (const AwayRow& row : {AwayRow{"operator", true, JigVerdict::stopped},
                             AwayRow{"button", false, JigVerdict::inconclusive}}) {
    VirtualBench bench;
    bench.on_action = [&](const JigAction& action) {
      if (action.kind == JigAction::Kind::accepted) {
        bench.plugged->unplugged = true;
      }
    };
    JigHooks hooks;
    hooks.on_action = bench.on_action;
    std::vector<OperatorCommand> said;
    hooks.next_command = [&]() -> std::optional<OperatorCommand> {
      if (said.empty()) {
        return std::nullopt;
      }
      const OperatorCommand first = said.front();
      said.erase(said.begin());
      return first;
    };
    int looks = 0;
    hooks.reopen = [&](const Error&, const JigHooks::Look& look) -> Result<UnitOnJig> {
      EXPECT_OK(look());
      if (row.by_operator) {
        said = {OperatorCommand::undo, OperatorCommand::stop};
      } else {
        EXPECT_OK(bench.jig->stop());
      }
      bench.plugged->unplugged = false;
      const Status again = look();
      ++looks;
      EXPECT_FALSE(again);
      return fail(again.error());
    };
    JigSessionOptions options;
    options.keep_interrupted = true;
    const auto report = run_jig(bench.on_jig(), bench.env.env, options, hooks);
    ASSERT_OK(report);
    EXPECT_EQ(looks, 1) << row.name;
    EXPECT_EQ(report->verdict, row.verdict) << row.name << report->brief();
    EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0) << row.name;
    EXPECT_TRUE(bench.plugged->motor.stopped) << row.name;
  }
}

// A driver that does not look, or a stop between its look and the return of the unit.
TEST(JigSession, AStoppedJigIsNotMovedWhenTheUnitIsBack) {
  VirtualBench bench;
  JigHooks hooks;
  hooks.on_action = [&](const JigAction& action) {
    if (action.kind == JigAction::Kind::accepted) {
      bench.plugged->unplugged = true;
    }
  };
  hooks.reopen = [&](const Error&, const JigHooks::Look&) -> Result<UnitOnJig> {
    EXPECT_OK(bench.jig->stop());
    bench.plugged->unplugged = false;
    bench.unit = *device::WireUnit::open(mocks::link_to(bench.plugged, false));
    return bench.on_jig();
  };
  EXPECT_FAILS(run_jig(bench.on_jig(), bench.env.env, {}, hooks), ErrorCode::device_unavailable);
  EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0);
}

// Oracle: the samples in the reports that the cable loses, counted where they are lost: before and
// after a write, and before and after the unit was unplugged.
TEST(JigSession, LossesCountOverTheWholeRun) {
  VirtualBench bench;
  std::uint64_t lost = 0;
  std::uint64_t came = 0;
  std::uint64_t pending = 0;  // lost, and not yet followed by a report that shows it
  int reports = 0;
  const auto open = [&] {
    device::Link link = mocks::link_to(bench.plugged, false);
    pending = 0;
    link.reports = std::make_unique<mocks::TamperingTransport>(
        std::move(link.reports), nullptr, [&](Bytes& bytes) {
          const auto message = device::decode(bytes);
          if (!message || message->kind != device::ReportKind::samples) {
            return 1;
          }
          const std::size_t count = device::decode_samples(*message)->counts.size();
          if (++reports % 700 == 7) {
            pending += count;
            return 0;
          }
          lost += std::exchange(pending, 0);
          came += count;
          return 1;
        });
    return *device::WireUnit::open(std::move(link));
  };
  bench.unit = open();
  int accepted = 0;
  JigHooks hooks;
  hooks.on_action = [&](const JigAction& action) {
    accepted += action.kind == JigAction::Kind::accepted ? 1 : 0;
    if (accepted == 8 && action.kind == JigAction::Kind::accepted) {
      bench.plugged->unplugged = true;
    }
  };
  hooks.reopen = [&](const Error&, const JigHooks::Look&) -> Result<UnitOnJig> {
    bench.plugged->unplugged = false;
    bench.unit = open();
    return bench.on_jig();
  };
  JigSessionOptions options;
  options.run.write = true;
  const auto report = run_jig(bench.on_jig(), bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_TRUE(report->written) << report->brief();
  ASSERT_GT(lost, 20U);
  EXPECT_EQ(report->stream.lost_samples, lost);
  // The blocks that wait when a stream ends were counted by the unit's link and not read.
  EXPECT_NEAR(static_cast<double>(report->stream.samples), static_cast<double>(came),
              0.001 * static_cast<double>(came));
  const auto quantity = std::ranges::find_if(report->quantities, [](const JudgedQuantity& each) {
    return each.name == "lost_samples_percent";
  });
  ASSERT_NE(quantity, report->quantities.end());
  EXPECT_NEAR(quantity->value, 100.0 * static_cast<double>(lost) / static_cast<double>(lost + came),
              0.001);
}

// The unit goes away at every single request before its first sample: a run that has begun waits.
TEST(JigSession, AUnitThatGoesAwayWhileTheRunBeginsIsWaitedFor) {
  int away = 0;
  for (int away_at = 1; away_at <= 8; ++away_at) {
    VirtualBench bench;
    int requests = -1000;  // opening it takes some
    const auto open = [&] {
      device::Link link = mocks::link_to(bench.plugged, false);
      link.reports = std::make_unique<mocks::TamperingTransport>(
          std::move(link.reports),
          [&](Bytes&) {
            if (++requests == away_at) {
              bench.plugged->unplugged = true;
            }
            return 1;
          },
          nullptr);
      return device::WireUnit::open(std::move(link));
    };
    bench.unit = *open();
    requests = 0;
    JigHooks hooks;
    hooks.reopen = [&](const Error&, const JigHooks::Look&) -> Result<UnitOnJig> {
      ++away;
      bench.plugged->unplugged = false;
      SIXPOINT_ASSIGN(bench.unit, open());
      return bench.on_jig();
    };
    const auto report = run_jig(bench.on_jig(), bench.env.env, {}, hooks);
    ASSERT_OK(report);
    EXPECT_EQ(report->verdict, JigVerdict::pass) << away_at << ' ' << report->brief();
    EXPECT_TRUE(report->as_found);
  }
  EXPECT_GE(away, 5);
}

// The unit goes away at every single request of the write and of the reading that follows, and is
// back or not, and goes away a second time or not. Oracle: the page in the unit's memory.
TEST(JigSession, AsLeftIsWhatTheUnitHoldsOrUnknown) {
  struct Row {
    int first;   // request since the write began, at which the unit goes away
    int second;  // and again, counted from its return; 0: it stays. -1: it does not come back
  };
  std::vector<Row> rows;
  for (int first = 1; first < 60; first += 4) {
    rows.push_back({first, 0});
    rows.push_back({first, -1});
    rows.push_back({first, 1 + first % 9});
    rows.push_back({first, 20 + first});
  }
  int unknown = 0;
  int known = 0;
  for (const Row& row : rows) {
    VirtualBench bench;
    bool writing = false;
    bool noted = false;
    int requests = 0;
    int returns = 0;
    int away_at = row.first;
    const auto open = [&] {
      device::Link link = mocks::link_to(bench.plugged, false);
      link.reports = std::make_unique<mocks::TamperingTransport>(
          std::move(link.reports),
          [&](Bytes& bytes) {
            const auto message = device::decode(bytes);
            if (writing && message && message->command == device::Command::write_staged) {
              EXPECT_TRUE(noted) << "the first byte goes out after the note";
            }
            if (writing && away_at > 0 && ++requests == away_at) {
              bench.plugged->unplugged = true;
              bench.plugged->unit.cut_power(bench.clock->elapsed());
            }
            return 1;
          },
          nullptr);
      return device::WireUnit::open(std::move(link));
    };
    bench.unit = *open();
    JigHooks hooks;
    hooks.on_action = [&](const JigAction& action) {
      writing = writing || action.kind == JigAction::Kind::write;
    };
    hooks.write_begins = [&](const JigReport& report, const JigRun&) -> Status {
      noted = report.write_begun;
      return {};
    };
    hooks.reopen = [&](const Error& gone, const JigHooks::Look&) -> Result<UnitOnJig> {
      ++returns;
      if (row.second < 0 || returns > 2 || (returns > 1 && row.second > 0)) {
        return fail(ErrorCode::device_unavailable, "it does not come back", gone.where);
      }
      bench.plugged->unplugged = false;
      bench.plugged->unit.restore_power(bench.clock->elapsed());
      requests = 0;
      away_at = row.second;
      SIXPOINT_ASSIGN(bench.unit, open());
      return bench.on_jig();
    };
    JigSessionOptions options;
    options.run.write = true;
    options.keep_interrupted = true;
    const auto report = run_jig(bench.on_jig(), bench.env.env, options, hooks);
    ASSERT_OK(report);
    if (row.second == 0) {
      EXPECT_EQ(report->verdict, JigVerdict::pass) << row.first << ' ' << report->brief();
      EXPECT_TRUE(report->written);
    }
    if (!report->as_left) {
      ++unknown;
      EXPECT_FALSE(report->usable());
      EXPECT_THAT(report->reasons, Contains(HasSubstr("a write of the constants was begun")));
      continue;
    }
    ++known;
    bench.plugged->unplugged = false;
    bench.plugged->unit.restore_power(bench.clock->elapsed());
    const auto holds =
        (*device::WireUnit::open(mocks::link_to(bench.plugged, false)))->read_calibration();
    ASSERT_OK(holds);
    EXPECT_EQ(report->as_left->constants, holds->constants)
        << row.first << ' ' << row.second << ' ' << report->brief();
  }
  EXPECT_GT(unknown, 10);
  EXPECT_GT(known, 10);
}

TEST(JigSession, AWriteThatCannotBeNotedDownIsNotBegun) {
  VirtualBench bench;
  JigHooks hooks;
  hooks.write_begins = [](const JigReport&, const JigRun&) -> Status {
    return fail(ErrorCode::io, "the disk is full");
  };
  JigSessionOptions options;
  options.run.write = true;
  const auto report = run_jig(bench.on_jig(), bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::inconclusive) << "it says nothing of the unit";
  EXPECT_THAT(report->codes, Contains("interrupted"));
  EXPECT_EQ(report->ended_by.value_or(Error{}).code, ErrorCode::io);
  EXPECT_THAT(report->reasons, Contains(HasSubstr("the disk is full")));
  EXPECT_EQ(report->as_left->constants, report->as_found->constants);
  EXPECT_EQ(bench.unit->read_calibration()->constants, report->as_found->constants);
}

// As a program that was killed leaves it.
TEST(JigSession, AUnitThatWasLeftStreamingIsMeasuredAllTheSame) {
  VirtualBench bench;
  ASSERT_OK(bench.unit->start_stream(50));
  ASSERT_FALSE(bench.unit->set_filter(FilterConfiguration::legacy)) << "it is busy";
  const auto report = run_jig(bench.on_jig(), bench.env.env, {}, {});
  ASSERT_OK(report);
  EXPECT_EQ(report->verdict, JigVerdict::pass) << report->brief();
}

JigSessionOptions with_half_turns() {
  JigSessionOptions options;
  options.run.protocol = JigProtocol::production_plus;
  options.keep_interrupted = true;
  return options;
}

// Oracle: the same unit by the protocol `production`, to the last digit.
TEST(JigSession, TheHalfTurnsChangeNeitherConstantsNorVerdict) {
  VirtualBench plain;
  VirtualBench bench;
  const auto production = plain.run();
  const auto plus = bench.run(with_half_turns());
  ASSERT_OK(production);
  ASSERT_OK(plus);
  ASSERT_EQ(plus->half_turn.size(), 3U);
  EXPECT_EQ(bench.plugged->motor.movements, plain.plugged->motor.movements + 3);
  EXPECT_EQ(plus->six->best().calibration.zero_lsb, production->six->best().calibration.zero_lsb);
  EXPECT_EQ(plus->six->best().calibration.sensitivity_g_per_lsb,
            production->six->best().calibration.sensitivity_g_per_lsb);
  EXPECT_EQ(plus->verification.worst_mg, production->verification.worst_mg);
  EXPECT_EQ(plus->verdict, production->verdict);
  // The report of a production run is what it was, and says its protocol.
  auto json = production->to_json();
  EXPECT_EQ(json["protocol"], "production");
  EXPECT_FALSE(json.contains("half_turn"));
  EXPECT_FALSE(json["poses"][0].contains("turned_deg"));
  json = plus->to_json();
  EXPECT_EQ(json["protocol"], "production+");
  EXPECT_EQ(json["poses"].size(), 6U);
  EXPECT_EQ(json["poses"][0]["turned_deg"], 0);
  EXPECT_EQ(json["verification"]["poses"].size(), 8U);
  EXPECT_EQ(json["half_turn"].size(), 3U);
  EXPECT_EQ(json["half_turn"][0]["turned_deg"], 180);
}

TEST(JigSession, HalfTurnsComeBeforeAWrite) {
  VirtualBench bench;
  JigSessionOptions options = with_half_turns();
  options.run.write = true;
  const auto report = bench.run(options);
  ASSERT_OK(report);
  EXPECT_TRUE(report->written);
  EXPECT_EQ(report->recheck.poses.size(), 2U);
  ASSERT_EQ(report->half_turn.size(), 3U);
  ASSERT_FALSE(report->recheck.poses.empty());
  EXPECT_LT(report->half_turn.back().start_s, report->recheck.poses.front().reading.start_s);
}

TEST(JigSession, AJigThatCannotTurnAboutTheVerticalIsRefusedBeforeItMoves) {
  VirtualBench bench;
  mocks::InertJig motor;
  const auto report = run_jig({bench.unit.get(), &motor}, bench.env.env, with_half_turns(), {});
  EXPECT_FAILS(report, ErrorCode::usage);
  EXPECT_TRUE(motor.poses.empty());
}

// In the first reading of a half-turned face: unplugged and back, or the jig's stop.
TEST(JigSession, AHalfTurnThatIsInterrupted) {
  for (const bool stops : {false, true}) {
    VirtualBench bench;
    int accepted = 0;
    JigHooks hooks;
    hooks.on_action = [&](const JigAction& action) {
      accepted += action.kind == JigAction::Kind::accepted ? 1 : 0;
    };
    bool done = false;
    hooks.samples = [&](const device::SampleBlock&, const JigRun& run) {
      if (!done && accepted == 15 && run.live().dwell_fraction > 0.5) {
        done = true;
        if (stops) {
          EXPECT_OK(bench.jig->stop());
        } else {
          bench.plugged->unplugged = true;
        }
      }
    };
    hooks.reopen = [&](const Error&, const JigHooks::Look&) -> Result<UnitOnJig> {
      bench.plugged->unplugged = false;
      bench.unit = *device::WireUnit::open(mocks::link_to(bench.plugged, false));
      return bench.on_jig();
    };
    const auto report = run_jig(bench.on_jig(), bench.env.env, with_half_turns(), hooks);
    ASSERT_OK(report);
    EXPECT_TRUE(done);
    EXPECT_EQ(report->verdict, stops ? JigVerdict::inconclusive : JigVerdict::pass)
        << report->brief();
    EXPECT_EQ(report->half_turn.size(), stops ? 1U : 3U);
    EXPECT_EQ(report->faces.size(), 6U);
    EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0);
  }
}

}  // namespace
}  // namespace sixpoint::station
