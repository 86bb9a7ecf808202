// Calibration files recorded in a lane.
#include "base/forwarding_files.h"
#include "base/sha256.h"
#include "station/lanes/run_folder.h"
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

constexpr const char* kCaptured = "virtual:seed=7,serial=MOS2A45130007,pace=100";

Json check_file(const Station& station, const std::string& name, bool save) {
  const Json body = {{"file", name}, {"save", save}};
  const auto answer = station.client().Post("/api/check", body.dump(), "text/plain");
  EXPECT_EQ(answer->status, 200) << answer->body;
  return Json::parse(answer->body);
}

TEST(LaneCapture, RecordsACalibrationFileSideAfterSide) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.start("/api/capture", {{"lane", 1}});
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["kind"], "capture");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_EQ(lane["result"]["stored"], true);
  EXPECT_FALSE(lane["result"].contains("problem"));
  const Json files = station.get("/api/files?path=");
  ASSERT_EQ(files["files"].size(), 1U);
  const std::string name = files["files"][0]["name"];
  const Json check = check_file(station, name, false);
  EXPECT_EQ(check["usable"], true);
  EXPECT_TRUE(check["repeat_sides"].empty());
  EXPECT_TRUE(check["constants_file"].is_null());
  EXPECT_EQ(check_file(station, name, true)["constants_file"], name + ".constants.json");
}

// The store has the constants all the same, and nobody is told of a file that is not there.
TEST(LaneCapture, AConstantsFileThatWasNotWrittenIsSaid) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.constants_file_problem = Error{ErrorCode::io, "no space left", "x.json", "make room"};
  station.start("/api/capture", {{"lane", 1}});
  const Json result = station.wait_state(1, "done")["result"];
  EXPECT_EQ(result["stored"], true) << result.dump(1);
  EXPECT_EQ(result["problem"], "x.json: no space left; make room");
  const Json check = check_file(
      station, station.get("/api/files?path=")["files"][0]["name"].get<std::string>(), true);
  EXPECT_EQ(check["stored_id"], "c0ffee");
  EXPECT_TRUE(check["constants_file"].is_null());
  EXPECT_EQ(check["problem"], result["problem"]);
}

TEST(LaneCapture, ThatOtherConstantsApplyIsSaid) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.said = "stored, but others apply";
  station.start("/api/capture", {{"lane", 1}});
  const Json lane = station.wait_state(1, "done");
  ASSERT_FALSE(lane["log"].empty());
  EXPECT_EQ(lane["log"].back()["kind"], "problem");
  EXPECT_EQ(lane["log"].back()["text"], "stored, but others apply");
}

TEST(LaneCapture, ACaptureSurvivesAReplugAndAsksTheSideUnderWayAgain) {
  const tests::TemporaryFolder folder;
  Station station({kCaptured}, folder.path());
  station.start("/api/capture");
  EXPECT_THAT(place_sides(station, 2), testing::ElementsAre("+z", "-z"));
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  // Pulled out while it rests on the third side.
  const Json third = station.wait(1, [](const Json& json) {
    return json["capture"].is_object() && json["capture"]["number"] == 3;
  });
  ASSERT_EQ(station.post("/api/lanes/1/placed", Json::object()), 200);
  hand({{"do", "unplug"}});
  const Json away = station.wait_state(1, "unit_away");
  EXPECT_TRUE(away["capture"].is_object()) << "the capture is still there";
  hand({{"do", "plug"}});
  const Json back = station.wait(1, [](const Json& json) {
    return json["state"] == "capturing" && json["capture"]["side"].is_string();
  });
  EXPECT_EQ(back["capture"]["side"], third["capture"]["side"]) << "asked again";
  EXPECT_EQ(back["capture"]["placed"], false);
  // Once more, while it waits for the operator: it is noticed without any button.
  hand({{"do", "unplug"}});
  station.wait_state(1, "unit_away");
  hand({{"do", "plug"}});
  station.wait_state(1, "capturing");
  const auto rest = place_sides(station, 6);
  ASSERT_EQ(rest.size(), 4U) << "the two that were done are not asked again";
  EXPECT_EQ(rest.front(), third["capture"]["side"].get<std::string>());
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_TRUE(lane["capture"].is_null());
  // The file that was put together from the pieces is a calibration file like any other.
  std::string file = lane["result"]["file"];
  file = file.substr(folder.path().size() + 1);
  const auto answer =
      station.client().Post("/api/check", Json{{"file", file}}.dump(), "application/json");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(Json::parse(answer->body)["usable"], true);
}

TEST(LaneCapture, AnotherUnitInACaptureIsNoticedAndNothingIsMixed) {
  const tests::TemporaryFolder folder;
  Station station({kCaptured}, folder.path());
  station.start("/api/capture");
  place_sides(station, 1);
  expect_swap_is_noticed(station);
}

TEST(LaneCapture, ACaptureSurvivesTheProgram) {
  const tests::TemporaryFolder folder;
  const auto bench = std::make_shared<mocks::VirtualBench>();  // the units go on without it
  {
    Station station({kCaptured}, folder.path(), 24, bench);
    station.start("/api/capture", {{"operator", "Ada"}});
    EXPECT_EQ(place_sides(station, 3).size(), 3U);
  }
  {
    Station station({kCaptured}, folder.path(), 24, bench);
    station.wait(1, [](const Json& json) {
      return json["state"] == "capturing" && json["capture"]["number"] == 4;
    });
    EXPECT_EQ(station.lane(1)["operator"], "Ada");
    EXPECT_EQ(place_sides(station, 6).size(), 3U) << "the first three stay";
    const Json lane = station.wait_state(1, "done");
    EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
    EXPECT_EQ(lane["result"]["stored"], true);
  }
  Station station({kCaptured}, folder.path(), 24, bench);
  station.wait_state(1, "idle");  // nothing is left to go on with
}

// Sides were asked for again, and the program ended; the next one waits for the unit in vain. The
// file of before is judged: here it is a good one.
TEST(LaneCapture, WithoutItsUnitACaptureThatWasAskedForAgainLeavesTheFileOfBefore) {
  const tests::TemporaryFolder folder;
  const auto bench = std::make_shared<mocks::VirtualBench>();
  const std::string device = "virtual:seed=7,serial=MOS2A45130007,jig=auto";
  std::string file;
  {
    Station station({device}, folder.path(), 24, bench);
    station.start("/api/capture");
    file = station.wait_state(1, "done")["result"]["file"];
    ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "unplug"}}), 200);
  }
  UnfinishedCapture left;
  left.serial = "MOS2A45130007";
  left.output = file;
  left.resume.asked_again = 1;
  left.resume.started = *parse_iso8601("2026-01-02T03:04:05");
  ASSERT_OK(
      RunFolder(posix_env(), folder.path() + "/state/lane-1-" + text_sha256(device).substr(0, 8))
          .save_capture(left));
  Station station({device}, folder.path(), 24, bench);
  station.wait_state(1, "unit_away");
  ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object(), ""), 200);
  const Json lane = station.wait(1, [](const Json& json) { return json["result"].is_object(); });
  EXPECT_EQ(lane["result"]["file"], file) << lane["result"].dump(1);
  EXPECT_EQ(lane["result"]["verdict"], "pass");
  EXPECT_EQ(lane["result"]["stored"], true);
  EXPECT_THAT(lane["result"]["notes"].dump(), HasSubstr("the recording of before is judged"));
}

// A unit that lost its memory meanwhile: a note says so, and all sides are asked for again.
TEST(LaneCapture, ACaptureStartsAgainWhenTheUnitHasLostItsRecording) {
  const tests::TemporaryFolder folder;
  {
    Station station({kCaptured}, folder.path());
    station.start("/api/capture");
    EXPECT_EQ(place_sides(station, 2).size(), 2U);
  }
  Station station({kCaptured}, folder.path());  // a unit that knows nothing of it
  station.wait_state(1, "capturing");
  EXPECT_EQ(place_sides(station, 6).size(), 6U);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_THAT(lane["result"]["notes"].dump(), HasSubstr("lost its recording; 2 sides are"));
}

class FilesWithDefect final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status rename(const std::string& from, const std::string& to) override {
    if (to.ends_with("/capture.json") && ++saved == 3) {
      throw std::runtime_error("no such key");
    }
    return ForwardingFiles::rename(from, to);
  }
  std::atomic<int> saved{0};
};

// Oracle: a unit that records sends no live readings.
TEST(LaneCapture, ADefectDoesNotLeaveTheUnitRecording) {
  const tests::TemporaryFolder folder;
  FilesWithDefect files(posix_env().files);
  Env env{posix_env().clock, files};
  mocks::VirtualBench bench;
  device::TransportRegistry registry = known_devices();
  bench.register_in(registry);
  LanesOptions options;
  options.devices = {"virtual:seed=7,jig=auto"};
  options.state_folder = folder / "state";
  options.capture_folder = folder.path();
  options.silence_s = 0.2;
  const auto lanes = Lanes::open(env, registry, options, {}, {});
  ASSERT_OK(lanes);
  const auto wait = [&](auto ready) {
    for (int i = 0; i < 1000; ++i) {
      if (ready((*lanes)->to_json(1))) {
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  };
  ASSERT_TRUE(wait([](const Json& json) { return json["state"] == "idle"; }));
  ASSERT_TRUE((*lanes)->start_capture(1, {}).has_value());
  ASSERT_TRUE(wait([](const Json& json) {
    return json["result"].is_object() && json["result"]["verdict"] == "inconclusive";
  }));
  EXPECT_EQ(files.saved, 3) << "two sides were begun";
  const std::uint64_t seen = (*lanes)->trace(1, ~std::uint64_t{0}).first;
  EXPECT_TRUE(
      wait([&](const Json&) { return (*lanes)->trace(1, ~std::uint64_t{0}).first > seen; }));
}

struct JumpingClock : Clock {
  UtcTime now() override { return posix_env().clock.now() + std::chrono::hours(hours); }
  std::chrono::nanoseconds elapsed() override { return posix_env().clock.elapsed(); }
  void sleep(std::chrono::nanoseconds duration) override { posix_env().clock.sleep(duration); }
  std::atomic<int> hours{0};
};

// A machine that gets the right time while a side is asked for: no one waited for hours.
TEST(LaneCapture, ACalendarThatIsSetEndsNoCapture) {
  const tests::TemporaryFolder folder;
  JumpingClock clock;
  Env env{clock, posix_env().files};
  const auto bench = std::make_shared<mocks::VirtualBench>();
  device::TransportRegistry registry = known_devices();
  bench->register_in(registry);
  LanesOptions options;
  options.devices = {kCaptured};
  options.state_folder = folder / "state";
  options.capture_folder = folder.path();
  const auto lanes = Lanes::open(env, registry, options, {}, {});
  ASSERT_OK(lanes);
  const auto wait = [&](auto ready) {
    for (int i = 0; i < 3000 && !ready((*lanes)->to_json(1)); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  };
  wait([](const Json& json) { return json["state"] == "idle"; });
  ASSERT_TRUE((*lanes)->start_capture(1, {}).has_value());
  wait([](const Json& json) {
    return json["capture"].is_object() && json["capture"]["side"].is_string();
  });
  ASSERT_TRUE((*lanes)->to_json(1)["capture"].is_object());
  ASSERT_TRUE((*lanes)->to_json(1)["capture"]["side"].is_string());
  clock.hours = 2;
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // three looks at the time
  EXPECT_EQ((*lanes)->state(1), LaneState::capturing);
}

TEST(LaneCapture, AUnitOfTheWrongFilterIsRefused) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto,firmware=1.8.0"}, folder.path());
  station.start("/api/capture");
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "refused");
  EXPECT_THAT(lane["result"]["reasons"].dump(), HasSubstr("firmware from 1.4.0 to 1.7.0"));
}

}  // namespace
}  // namespace sixpoint::station
