#include "station/capture/capture_run.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/sha256.h"
#include "calib/poses/efficiency.h"
#include "expect_result.h"
#include "mocks/inert/inert.h"
#include "station/virtual_bench.h"

namespace sixpoint::station {
namespace {

using calib::FilterConfiguration;
using testing::Contains;
using testing::HasSubstr;

const CaptureHooks kAlwaysPlaced{
    .ask = [](device::Pose, std::size_t, std::size_t) { return SideAnswer::placed; }};

// Oracle: the virtual unit's truth. Still blocks of a six-sided file: 2 mg.
TEST(CaptureRun, RecordsDownloadsAndSolves) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    VirtualBench bench(seed);
    CaptureOptions options;
    options.output = "c.gt3x";
    const auto report = run_capture(bench.on_jig(), bench.env.env, options, kAlwaysPlaced);
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

// Six sides leave nothing to test the constants with; with the corners, directions that the fit has
// not seen do. Oracle: the virtual unit's truth, to a third of what the sides alone are held to.
TEST(CaptureRun, CornersComeAfterTheSidesAndTestTheConstants) {
  VirtualBench bench;
  CaptureOptions options;
  options.output = "c.gt3x";
  options.corners = true;
  std::vector<std::string> asked;
  CaptureHooks hooks;
  hooks.ask = [&](device::Pose side, std::size_t number, std::size_t of) {
    asked.emplace_back(device::to_string(side));
    EXPECT_EQ(number, asked.size());
    EXPECT_EQ(of, 14U);
    return SideAnswer::placed;
  };
  hooks.ask_corner = [&](const device::Corner& corner, std::size_t number, std::size_t of) {
    asked.push_back(device::to_string(corner));
    EXPECT_EQ(number, asked.size());
    EXPECT_EQ(of, 14U);
    return SideAnswer::placed;
  };
  std::vector<CaptureResume::Side> done;
  hooks.progress = [&](const CaptureResume& resume) { done = resume.done; };
  const auto report = run_capture(bench.on_jig(), bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_THAT(asked,
              testing::ElementsAre("+z", "-z", "+x", "-x", "+y", "-y", "+x+y+z", "-x+y+z", "-x-y+z",
                                   "+x-y+z", "+x-y-z", "-x-y-z", "-x+y-z", "+x+y-z"));
  EXPECT_EQ(done.size(), 14U);
  ASSERT_TRUE(report->solved);
  EXPECT_EQ(report->solved->verification.verdict, calib::Verdict::verified)
      << report->solved->brief();
  EXPECT_EQ(report->solved->fit->directions, 14);
  EXPECT_GT(calib::efficiency_of(*report->solved->fit, 9).d, 0.97);
  const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(report->solved->calibration->sensitivity_g_per_lsb[axis] *
                    truth.sensitivity_lsb_per_g[axis],
                1, 1e-3);
    EXPECT_NEAR(report->solved->calibration->zero_lsb[axis], truth.zero_lsb[axis], 0.3);
  }
}

// A person stands it there; a motor that knows six sides does not begin.
TEST(CaptureRun, CornersByHandAndNotByAMotorOfSixSides) {
  VirtualBench bench;
  device::ManualJig hands;
  CaptureOptions options;
  options.output = "c.gt3x";
  options.corners = true;
  CaptureHooks hooks;
  hooks.ask = [&](device::Pose side, std::size_t, std::size_t) {
    return bench.jig->go_to(side) ? SideAnswer::placed : SideAnswer::stop;
  };
  hooks.ask_corner = [&](const device::Corner& corner, std::size_t, std::size_t) {
    return bench.jig->go_to_corner(corner) ? SideAnswer::placed : SideAnswer::stop;
  };
  const auto report = run_capture({bench.unit.get(), &hands}, bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_EQ(report->solved->fit->directions, 14);

  struct Motor final : device::Jig {
    std::string name() const override { return "motor"; }
    bool turns_by_itself() const override { return true; }
    Status go_to(device::Pose) override { return {}; }
    Result<device::JigPosition> position() override { return device::JigPosition{}; }
    Status stop() override { return {}; }
    Status release() override { return {}; }
  } motor;
  options.output = "d.gt3x";
  const std::size_t recordings = bench.unit->recordings()->size();
  EXPECT_FAILS(run_capture({bench.unit.get(), &motor}, bench.env.env, options, hooks),
               ErrorCode::usage);
  EXPECT_EQ(bench.unit->recordings()->size(), recordings) << "nothing was begun";
}

TEST(CaptureRun, RefusesAUnitWhoseRecordingCannotHelp) {
  for (const char* firmware : {"1.2.0", "1.8.0"}) {
    sim::GivenProperties given;
    given.firmware = firmware;
    VirtualBench bench(7, given);
    CaptureOptions options;
    options.output = "c.gt3x";
    const auto report = run_capture(bench.on_jig(), bench.env.env, options, kAlwaysPlaced);
    ASSERT_OK(report);
    EXPECT_FALSE(report->usable());
    EXPECT_THAT(report->refusal, Contains(HasSubstr("firmware from 1.4.0 to 1.7.0")));
    EXPECT_FALSE(bench.env.files.info("c.gt3x"));
    EXPECT_TRUE(bench.unit->recordings()->empty()) << "nothing was recorded";
  }
  sim::GivenProperties later;
  later.firmware = "1.8.0";
  later.calibrated = *parse_iso8601("2015-01-01");
  VirtualBench bench(7, later);
  CaptureOptions options;
  options.output = "c.gt3x";
  EXPECT_TRUE(run_capture(bench.on_jig(), bench.env.env, options, kAlwaysPlaced)->usable());
}

TEST(CaptureRun, SidesThatWereLeftOutAreNamed) {
  VirtualBench bench;
  mocks::InertJig lazy;  // never turns it
  CaptureOptions options;
  options.output = "c.gt3x";
  const auto report = run_capture({bench.unit.get(), &lazy}, bench.env.env, options, kAlwaysPlaced);
  ASSERT_OK(report);
  EXPECT_FALSE(report->usable());
  const auto& missing = report->solved->verification.missing_directions;
  EXPECT_THAT(missing, Contains("-z"));
  EXPECT_GE(missing.size(), 4U);
}

// A person who errs: the jig lays the unit where the person does, not where it was asked for.
struct Person {
  explicit Person(VirtualBench& its_bench) : bench(its_bench) {
    hooks.ask = [this](device::Pose side, std::size_t, std::size_t) {
      asked.push_back(side);
      const device::Pose laid = errs(side) ? device::Pose::plus_z : side;
      return bench.jig->go_to(laid) ? SideAnswer::placed : SideAnswer::stop;
    };
    hooks.again = [this](const std::vector<device::Pose>& sides) { repeated.push_back(sides); };
    options.output = "c.gt3x";
  }
  bool errs(device::Pose side) { return side == wrong && errors-- > 0; }
  Result<CaptureReport> capture() {
    return run_capture({bench.unit.get(), &lazy}, bench.env.env, options, hooks);
  }
  VirtualBench& bench;
  mocks::InertJig lazy;  // the hands are in `ask`
  CaptureOptions options;
  CaptureHooks hooks;
  device::Pose wrong = device::Pose::minus_x;
  int errors = 1;
  std::vector<device::Pose> asked;
  std::vector<std::vector<device::Pose>> repeated;
};

// Oracle: the sides that the person was asked for, and the virtual unit's truth.
TEST(CaptureRun, AWrongSideIsAskedForAgainAloneAndTheOthersAreKept) {
  VirtualBench bench;
  Person person(bench);
  const auto report = person.capture();
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable()) << report->solved->brief();
  ASSERT_EQ(person.asked.size(), 7U);
  EXPECT_EQ(person.asked.back(), device::Pose::minus_x);
  EXPECT_THAT(person.repeated, testing::ElementsAre(testing::ElementsAre(device::Pose::minus_x)));
  EXPECT_THAT(report->notes, Contains(HasSubstr("with -x up: asked for again")));
  EXPECT_EQ(report->pieces.size(), 2U);
  const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(report->solved->calibration->zero_lsb[axis], truth.zero_lsb[axis], 0.8);
  }
}

TEST(CaptureRun, ASideThatFailsAgainIsAskedForTwiceAndThenJudged) {
  VirtualBench bench;
  Person person(bench);
  person.errors = 100;
  const auto report = person.capture();
  ASSERT_OK(report);
  EXPECT_FALSE(report->usable());
  EXPECT_EQ(person.asked.size(), 8U);
  EXPECT_EQ(person.repeated.size(), 2U);
  EXPECT_THAT(report->solved->verification.missing_directions, testing::ElementsAre("-x"));

  VirtualBench second;
  Person corrects_late(second);
  corrects_late.errors = 2;
  const auto late = corrects_late.capture();
  ASSERT_OK(late);
  EXPECT_TRUE(late->usable()) << late->solved->brief();
}

TEST(CaptureRun, WhoStopsAtARepeatedSideGetsTheJudgementOfTheFile) {
  VirtualBench bench;
  Person person(bench);
  const auto ask = person.hooks.ask;
  person.hooks.ask = [&](device::Pose side, std::size_t number, std::size_t of) {
    return person.repeated.empty() ? ask(side, number, of) : SideAnswer::stop;
  };
  const auto report = person.capture();
  ASSERT_OK(report);
  EXPECT_FALSE(report->stopped);
  EXPECT_FALSE(report->usable());
  EXPECT_THAT(report->solved->verification.missing_directions, testing::ElementsAre("-x"));
  EXPECT_THAT(report->notes, Contains(HasSubstr("the recording of before is judged")));
  EXPECT_TRUE(bench.env.files.info("c.gt3x")) << "the file stays";
  ASSERT_OK(bench.unit->start_stream(100));  // not left recording
}

// The disk fails at each step of the second download: what was recorded before is there, and
// judged.
TEST(CaptureRun, AFileThatIsNotFetchedAnewLeavesTheOneOfBefore) {
  bool is_undisturbed = false;
  for (std::size_t step = 0; step < 2000; step += 1 + step / 8) {
    VirtualBench bench;
    Person person(bench);
    std::string before;
    const auto again = person.hooks.again;
    person.hooks.again = [&](const std::vector<device::Pose>& sides) {
      again(sides);
      before = *file_sha256(bench.env.files, "c.gt3x");
      bench.env.files.fail_after(step);
    };
    const auto report = person.capture();
    bench.env.files.stop_failing();
    ASSERT_OK(report);
    EXPECT_EQ(report->file, "c.gt3x");
    ASSERT_TRUE(bench.env.files.info("c.gt3x")) << "step " << step;
    const std::string now = *file_sha256(bench.env.files, "c.gt3x");
    if (report->usable()) {
      EXPECT_EQ(now, report->file_sha256);
      EXPECT_NE(now, before);
      EXPECT_FALSE(bench.env.files.info("c-new.gt3x"));
      for (const std::string& piece : report->pieces) {
        EXPECT_TRUE(bench.env.files.info(piece)) << piece;
      }
      if (!bench.env.files.info("c-new-1.gt3x")) {
        EXPECT_GT(step, 4U);
        is_undisturbed = true;
        break;
      }
      continue;
    }
    EXPECT_THAT(report->notes, Contains(HasSubstr("the recording of before is judged")));
    EXPECT_EQ(report->file_sha256, before);
  }
  EXPECT_TRUE(is_undisturbed) << "the last case is one in which nothing failed";
}

// Names of files in `bench` that begin so.
std::vector<std::string> files_from(VirtualBench& bench, const std::string& begin) {
  auto names = *bench.env.files.list(".");
  std::erase_if(names, [&](const std::string& name) { return !name.starts_with(begin); });
  return names;
}

// The program is killed at each step of the second download; the next one goes on and asks for a
// side again where one fails.
TEST(CaptureRun, WhatAKilledProgramFetchedAnewIsRemovedByTheNextOne) {
  std::size_t left_over = 0;
  for (std::size_t step = 0; step < 60; step += 1 + step / 8) {
    VirtualBench bench;
    Person person(bench);
    person.errors = 2;  // so that there is a side to ask for again after the restart
    CaptureResume last;
    person.hooks.progress = [&](const CaptureResume& resume) { last = resume; };
    const auto again = person.hooks.again;
    person.hooks.again = [&](const std::vector<device::Pose>& sides) {
      again(sides);
      bench.env.files.fail_after(step);  // from here on it changes nothing, as a killed program
    };
    ASSERT_OK(person.capture());
    bench.env.files.stop_failing();
    if (person.repeated.size() > 1) {
      break;  // the second download was done
    }
    ASSERT_EQ(last.asked_again, 1);
    left_over += files_from(bench, "c-new").size();
    // Names that this capture does not make.
    const std::vector<std::string> others = {
        "c-new-0.gt3x",     "c-new-9.gt3x", "c-new-1.gt3x.part",
        "c-new-1.gt3x.old", "c-newer.gt3x", "c-new-1.gt3x.0123456789abc.part"};
    for (const std::string& name : others) {
      ASSERT_OK(write_file(bench.env.files, name, "another's"));
    }
    person.hooks.again = again;
    person.repeated.clear();
    const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                    person.hooks, last);
    ASSERT_OK(report);
    EXPECT_TRUE(report->usable()) << "step " << step << ": "
                                  << testing::PrintToString(report->notes);
    EXPECT_EQ(person.repeated.size(), 1U) << "step " << step;
    EXPECT_THAT(files_from(bench, "c-new"), testing::UnorderedElementsAreArray(others));
  }
  EXPECT_GT(left_over, 5U) << "the program was killed while there was something";
}

// A capture whose side `person.wrong` is asked for again; the program ends before it is laid there.
// Where `begins_anew_at` is not 0, an earlier program had ended before that side, too. What was
// saved.
CaptureResume left_when_asked_again(Person& person, std::size_t begins_anew_at) {
  std::optional<CaptureResume> last;
  person.hooks.progress = [&](const CaptureResume& now) { last = now; };
  const auto ask = person.hooks.ask;
  bool leaves = begins_anew_at != 0;
  person.hooks.ask = [&](device::Pose side, std::size_t number, std::size_t of) {
    if (!person.repeated.empty() || (leaves && number == begins_anew_at)) {
      return SideAnswer::leave;
    }
    return ask(side, number, of);
  };
  if (leaves) {
    EXPECT_EQ(person.capture().error().code, ErrorCode::internal);
    leaves = false;
  }
  const auto resume = last;
  EXPECT_EQ(run_capture({person.bench.unit.get(), &person.lazy}, person.bench.env.env,
                        person.options, person.hooks, resume)
                .error()
                .code,
            ErrorCode::internal);
  EXPECT_EQ(person.repeated.size(), 1U);
  person.hooks.ask = ask;
  person.hooks.progress = nullptr;
  EXPECT_EQ(last->asked_again, 1);
  return *last;
}

// The recording that the file or a piece of before holds is no part of the new file, because all of
// its sides were asked for again.
TEST(CaptureRun, WhatWasAskedForAgainBeforeARestartReplacesTheFileOfBefore) {
  for (const bool in_pieces : {false, true}) {
    SCOPED_TRACE(in_pieces);
    VirtualBench bench;
    Person person(bench);
    person.wrong = in_pieces ? device::Pose::minus_y : device::Pose::minus_x;
    CaptureResume left = left_when_asked_again(person, in_pieces ? 6 : 0);
    if (!in_pieces) {
      left.done.clear();
    }
    ASSERT_EQ(left.done.size(), in_pieces ? 5U : 0U);
    const std::string before = *file_sha256(bench.env.files, "c.gt3x");
    person.hooks.progress = [](const CaptureResume& now) {
      EXPECT_EQ(now.asked_again, 1) << "a third program finds the same";
    };
    const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                    person.hooks, left);
    ASSERT_OK(report);
    EXPECT_TRUE(report->usable()) << testing::PrintToString(report->notes);
    EXPECT_EQ(report->pieces.size(), in_pieces ? 2U : 0U);
    EXPECT_EQ(files_from(bench, "c-").size(), report->pieces.size());
    EXPECT_EQ(report->file, "c.gt3x");
    EXPECT_EQ(*file_sha256(bench.env.files, "c.gt3x"), report->file_sha256);
    EXPECT_NE(report->file_sha256, before);
  }
}

TEST(CaptureRun, WhoStopsAfterARestartGetsTheJudgementOfTheFileOfBefore) {
  VirtualBench bench;
  Person person(bench);
  const CaptureResume left = left_when_asked_again(person, 0);
  const std::string before = *file_sha256(bench.env.files, "c.gt3x");
  person.hooks.ask = [](device::Pose, std::size_t, std::size_t) { return SideAnswer::stop; };
  const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                  person.hooks, left);
  ASSERT_OK(report);
  EXPECT_FALSE(report->stopped);
  EXPECT_EQ(report->file, "c.gt3x");
  EXPECT_EQ(report->file_sha256, before);
  EXPECT_EQ(*file_sha256(bench.env.files, "c.gt3x"), before);
  ASSERT_TRUE(report->solved);
  EXPECT_THAT(report->solved->verification.missing_directions, testing::ElementsAre("-x"));
  EXPECT_THAT(report->notes, Contains(HasSubstr("the recording of before is judged")));
}

// The two that one program was to ask at most, in two.
TEST(CaptureRun, ASideIsAskedForTwiceAtMostAlsoOverARestart) {
  VirtualBench bench;
  Person person(bench);
  person.errors = 100;
  const CaptureResume left = left_when_asked_again(person, 0);
  const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                  person.hooks, left);
  ASSERT_OK(report);
  EXPECT_FALSE(report->usable());
  EXPECT_EQ(person.repeated.size(), 2U);
}

class FilesThatUnplug final : public ForwardingFiles {
 public:
  FilesThatUnplug(VirtualBench& bench, std::string name)
      : ForwardingFiles(bench.env.files), bench_(bench), name_(std::move(name)) {}
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    if (path.starts_with(name_)) {
      const std::lock_guard lock(bench_.plugged->mutex);
      bench_.plugged->unplugged = true;
    }
    return ForwardingFiles::create(path);
  }

 private:
  VirtualBench& bench_;
  std::string name_;
};

// The unit is pulled out where something is asked about a file, or a folder is listed.
class FilesThatUnplugWhereAsked final : public ForwardingFiles {
 public:
  FilesThatUnplugWhereAsked(VirtualBench& bench, std::string about)
      : ForwardingFiles(bench.env.files), bench_(bench), about_(std::move(about)) {}
  Result<FileInfo> info(const std::string& path) override {
    look_at(path);
    return ForwardingFiles::info(path);
  }
  Result<std::vector<std::string>> list(const std::string& path) override {
    look_at(path);
    return ForwardingFiles::list(path);
  }

 private:
  void look_at(const std::string& path) {
    if (path == about_) {
      const std::lock_guard lock(bench_.plugged->mutex);
      bench_.plugged->unplugged = true;
    }
  }
  VirtualBench& bench_;
  std::string about_;
};

void plug(VirtualBench& bench, bool in) {
  const std::lock_guard lock(bench.plugged->mutex);
  bench.plugged->unplugged = !in;
}

// The program ends while the unit is out: before a side is asked for again, or before its recording
// is ended.
TEST(CaptureRun, ARepeatedSideWaitsForTheNextProgramWhereThisOneEndsWithoutTheUnit) {
  for (const bool is_asked : {false, true}) {
    SCOPED_TRACE(is_asked);
    VirtualBench bench;
    Person person(bench);
    FilesThatUnplugWhereAsked files(bench, is_asked ? "" : "c-new.gt3x");
    Env env{bench.env.env.clock, files};
    CaptureResume last;
    person.hooks.progress = [&](const CaptureResume& now) {
      last = now;
      if (is_asked && now.asked_again > 0 && now.done.size() == device::kPoses.size()) {
        plug(bench, false);
      }
    };
    person.hooks.reopen = [](const Error&) -> Result<UnitOnJig> {
      return fail(ErrorCode::internal, "the program ends", {}, "start it again");
    };
    EXPECT_FAILS(run_capture({bench.unit.get(), &person.lazy}, env, person.options, person.hooks),
                 ErrorCode::internal);
    plug(bench, true);
    bench.unit = *device::WireUnit::open(mocks::link_to(bench.plugged, false));
    person.hooks.progress = nullptr;
    const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                    person.hooks, last);
    ASSERT_OK(report);
    EXPECT_TRUE(report->usable()) << testing::PrintToString(report->notes);
    EXPECT_EQ(person.repeated.size(), 1U);
  }
}

// The unit is out for longer than is waited: from the start of the next program on, while its
// recording is begun anew, or while the side is asked for.
TEST(CaptureRun, WithoutItsUnitARepeatedSideLeavesTheFileOfBefore) {
  for (const std::string when : {"start", "begin", "side"}) {
    SCOPED_TRACE(when);
    VirtualBench bench;
    Person person(bench);
    const CaptureResume left = left_when_asked_again(person, 0);
    const std::string before = *file_sha256(bench.env.files, "c.gt3x");
    FilesThatUnplugWhereAsked files(bench, when == "begin" ? "." : "");
    Env env{bench.env.env.clock, files};
    plug(bench, when != "start");
    person.hooks.ask = [&](device::Pose, std::size_t, std::size_t) {
      plug(bench, false);
      return SideAnswer::waiting;
    };
    person.hooks.reopen = [](const Error&) -> Result<UnitOnJig> {
      return fail(ErrorCode::device_unavailable, "the unit did not come back");
    };
    const auto report =
        run_capture({bench.unit.get(), &person.lazy}, env, person.options, person.hooks, left);
    ASSERT_OK(report);
    EXPECT_EQ(report->file, "c.gt3x");
    EXPECT_EQ(report->file_sha256, before);
    ASSERT_TRUE(report->solved);
    EXPECT_THAT(report->solved->verification.missing_directions, testing::ElementsAre("-x"));
    EXPECT_THAT(report->notes, Contains(HasSubstr("the recording of before is judged")));
  }
}

// The unit goes away in the second download and does not come back.
TEST(CaptureRun, ThePartOfASecondDownloadThatBrokeOffIsRemoved) {
  VirtualBench bench;
  Person person(bench);
  FilesThatUnplug files(bench, "c-new-2.gt3x.");
  Env env{bench.env.clock, files};
  const auto report =
      run_capture({bench.unit.get(), &person.lazy}, env, person.options, person.hooks);
  ASSERT_OK(report);
  EXPECT_THAT(report->notes, Contains(HasSubstr("the recording of before is judged")));
  EXPECT_TRUE(bench.plugged->unplugged);
  EXPECT_THAT(files_from(bench, "c-new"), testing::IsEmpty());
  EXPECT_TRUE(bench.env.files.info("c.gt3x"));
}

// Without the word of the earlier program that the names were free, nothing is removed.
TEST(CaptureRun, AFileOfAnotherStaysWhereNoSideWasAskedForAgain) {
  VirtualBench bench;
  Person person(bench);
  ASSERT_OK(write_file(bench.env.files, "c-new-1.gt3x", "another's"));
  CaptureResume resume;
  person.hooks.progress = [&](const CaptureResume& now) { EXPECT_EQ(now.asked_again, 0); };
  const auto report = run_capture({bench.unit.get(), &person.lazy}, bench.env.env, person.options,
                                  person.hooks, resume);
  ASSERT_OK(report);
  EXPECT_THAT(report->notes, Contains(HasSubstr("there is a file c-new-1.gt3x")));
  EXPECT_EQ(bench.env.files.info("c-new-1.gt3x")->size, 9U);
}

// No file of another capture is replaced.
TEST(CaptureRun, NoSideIsAskedForAgainWhereAPieceWouldReplaceAFile) {
  VirtualBench bench;
  Person person(bench);
  ASSERT_OK(write_file(bench.env.files, "c-1.gt3x", "another capture"));
  const auto report = person.capture();
  ASSERT_OK(report);
  EXPECT_FALSE(report->usable());
  EXPECT_EQ(person.asked.size(), 6U);
  EXPECT_THAT(report->notes, Contains(HasSubstr("c-1.gt3x")));
  EXPECT_EQ(bench.env.files.info("c-1.gt3x")->size, 15U);
}

TEST(CaptureRun, ThePersonMayStopAndTheUnitIsNotLeftRecording) {
  VirtualBench bench;
  CaptureOptions options;
  options.output = "c.gt3x";
  CaptureHooks hooks;
  hooks.ask = [](device::Pose, std::size_t number, std::size_t) {
    return number < 3 ? SideAnswer::placed : SideAnswer::stop;
  };
  const auto report = run_capture(bench.on_jig(), bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_TRUE(report->stopped);
  ASSERT_OK(bench.unit->start_stream(100));  // not busy
}

TEST(CaptureRun, AUnitThatWasLeftStreamingRecords) {
  VirtualBench bench;
  ASSERT_OK(bench.unit->start_stream(50));
  CaptureOptions options;
  options.output = "c.gt3x";
  const auto report = run_capture(bench.on_jig(), bench.env.env, options, kAlwaysPlaced);
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable());
}

// A host that gets the right time in the middle: how long the unit recorded is what it was.
TEST(CaptureRun, ACalendarThatIsSetChangesNoDuration) {
  VirtualBench bench;
  CaptureOptions options;
  options.output = "c.gt3x";
  CaptureHooks hooks;
  hooks.ask = [&](device::Pose, std::size_t number, std::size_t) {
    if (number == 3) {
      bench.clock->set(bench.clock->now() + std::chrono::hours(2));
    }
    return SideAnswer::placed;
  };
  const auto report = run_capture(bench.on_jig(), bench.env.env, options, hooks);
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable()) << report->solved->brief();
  EXPECT_THAT(report->notes, testing::Not(Contains(HasSubstr("the recording holds"))));
}

TEST(CaptureRun, DoesNotWriteOverAFile) {
  VirtualBench bench;
  ASSERT_OK(bench.env.files.create("c.gt3x"));
  CaptureOptions options;
  options.output = "c.gt3x";
  EXPECT_FAILS(run_capture(bench.on_jig(), bench.env.env, options, kAlwaysPlaced),
               ErrorCode::cannot_create);
  EXPECT_TRUE(bench.unit->recordings()->empty());
}

}  // namespace
}  // namespace sixpoint::station
