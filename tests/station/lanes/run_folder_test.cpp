#include "station/lanes/run_folder.h"

#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "base/sha256.h"
#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

UnfinishedRun a_run() {
  UnfinishedRun run;
  run.device = "virtual:seed=7";
  run.serial = "MOS2A45130007";
  run.firmware = "1.5.0";
  run.operator_name = "Łukasz";
  run.station = "bench-1";
  run.client = "tab-1";
  run.write = true;
  run.filter = calib::FilterConfiguration::legacy;
  run.resume.started = *parse_iso8601("2026-01-02T03:04:05");
  run.resume.as_found = device::CalibrationPage{};
  run.resume.as_found->constants.zero_lsb = {1, -2, 3};
  run.resume.progress.refusals = 4;
  run.constants_id = "def456";
  run.resume.write_begun = true;
  run.resume.stream.samples = 1000;
  run.resume.stream.lost_samples = 12;
  return run;
}

std::string text_of_file(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// One damaged file takes nothing else with it.
TEST(RunFolder, ABadRunSetsAsideItselfAndItsSamplesAlone) {
  const tests::TemporaryFolder folder;
  RunFolder lane(posix_env(), folder / "lane");
  UnfinishedCapture capture;
  capture.serial = "MOS2A45130007";
  capture.resume.started = *parse_iso8601("2026-01-02T03:04:05");
  ASSERT_OK(lane.save_capture(capture));
  ASSERT_OK(lane.append("t,x,y,z,c\n"));
  ASSERT_OK(lane.close());
  std::ofstream(folder / "lane/run.json") << "{}";
  EXPECT_FAILS(lane.load(), ErrorCode::bad_data);
  ASSERT_OK(lane.set_aside_run());
  EXPECT_FALSE(posix_env().files.info(folder / "lane/samples-1.csv"));
  const auto left = lane.load_capture();
  ASSERT_OK(left);
  ASSERT_TRUE(left->has_value());
  EXPECT_EQ((*left)->serial, "MOS2A45130007");
  ASSERT_OK(lane.save(a_run()));
  std::ofstream(folder / "lane/capture.json") << "{}";
  EXPECT_FAILS(lane.load_capture(), ErrorCode::bad_data);
  ASSERT_OK(lane.set_aside_capture());
  EXPECT_TRUE((*lane.load()).has_value());
  EXPECT_FALSE((*lane.load_capture()).has_value());
}

// A folder of an earlier version has no `stream`, no `write_begun`, no `kind` and no id of
// constants.
TEST(RunFolder, AFolderOfAnEarlierVersionIsRead) {
  const tests::TemporaryFolder folder;
  RunFolder lane(posix_env(), folder / "lane");
  ASSERT_OK(lane.save(a_run()));
  auto json = nlohmann::ordered_json::parse(text_of_file(folder / "lane/run.json"));
  json.erase("stream");
  json.erase("write_begun");
  json.erase("kind");
  json.erase("constants_id");
  std::ofstream(folder / "lane/run.json") << json.dump();
  const auto left = lane.load();
  ASSERT_OK(left);
  EXPECT_FALSE((*left)->resume.write_begun);
  EXPECT_EQ((*left)->kind, "jig");
  EXPECT_EQ((*left)->constants_id, "");
  EXPECT_EQ((*left)->resume.stream.samples, 0U);
}

TEST(RunFolder, AnotherProgramFindsTheRunWithItsSamples) {
  const tests::TemporaryFolder folder;
  {
    RunFolder first(posix_env(), folder / "lane");
    ASSERT_OK(first.save(a_run()));
    ASSERT_OK(first.append("t,x,y,z,c\n1,2,3,4,25\n"));
    ASSERT_OK(first.close());
  }
  {
    RunFolder second(posix_env(), folder / "lane");
    ASSERT_OK(second.append("2,2,3,4,25\n"));
    ASSERT_OK(second.close());
  }
  RunFolder third(posix_env(), folder / "lane");
  const auto left = third.load();
  ASSERT_OK(left);
  ASSERT_TRUE(left->has_value());
  const UnfinishedRun& run = **left;
  EXPECT_EQ(run.serial, "MOS2A45130007");
  EXPECT_EQ(run.operator_name, "Łukasz");
  EXPECT_EQ(run.filter, calib::FilterConfiguration::legacy);
  EXPECT_TRUE(run.write);
  EXPECT_EQ(run.constants_id, "def456");
  EXPECT_TRUE(run.resume.write_begun);
  EXPECT_EQ(run.resume.stream.samples, 1000U);
  EXPECT_EQ(run.resume.stream.lost_samples, 12U);
  EXPECT_EQ(to_iso8601(run.resume.started), "2026-01-02T03:04:05Z");
  ASSERT_TRUE(run.resume.as_found);
  EXPECT_EQ(run.resume.as_found->constants.zero_lsb, (PerAxis<int>{1, -2, 3}));
  EXPECT_FALSE(run.resume.written);
  EXPECT_EQ(run.resume.progress.refusals, 4);
  EXPECT_EQ(run.resume.raw_csv, "t,x,y,z,c\n1,2,3,4,25\n2,2,3,4,25\n");
  ASSERT_OK(third.clear());
  EXPECT_FALSE(third.load()->has_value());
}

class WatchedFiles final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status sync_folder(const std::string& path) override {
    synced.insert(path);
    return ForwardingFiles::sync_folder(path);
  }
  std::set<std::string> synced;
};

// After a power cut the folder of the run has its name, too.
TEST(RunFolder, TheNamesOfItsFoldersAreOnTheMedium) {
  const auto expect_synced = [](auto work) {
    MemoryEnv memory;
    WatchedFiles files(memory.files);
    Env env{memory.clock, files};
    RunFolder lane(env, "state/lane");
    ASSERT_OK(work(lane));
    EXPECT_TRUE(files.synced.contains(".")) << "the name of state";
    EXPECT_TRUE(files.synced.contains("state")) << "the name of lane";
  };
  expect_synced([](RunFolder& lane) { return lane.save(a_run()); });
  expect_synced([](RunFolder& lane) { return lane.append("t,x,y,z,c\n"); });
}

// A power cut in clear() leaves samples without their state.
TEST(RunFolder, SamplesWithoutAStateGoIntoNoOtherRun) {
  for (const bool state_first : {false, true}) {
    const tests::TemporaryFolder folder;
    {
      RunFolder lane(posix_env(), folder / "lane");
      ASSERT_OK(lane.append("1,2,3,4,25\n"));
      ASSERT_OK(lane.close());
    }
    RunFolder lane(posix_env(), folder / "lane");
    UnfinishedRun run = a_run();
    if (state_first) {
      ASSERT_OK(lane.save(run));
    }
    const std::string rows = "5,6,7,8,25\n";
    ASSERT_OK(lane.append(rows));
    run.rows_bytes = rows.size();
    run.rows_sha256 = text_sha256(rows);
    ASSERT_OK(lane.save(run));
    const auto left = lane.load();
    ASSERT_OK(left);
    ASSERT_TRUE(left->has_value());
    EXPECT_EQ((*left)->resume.raw_csv, rows);
  }
}

TEST(RunFolder, AnIncompleteLastRowIsLeftOut) {
  const tests::TemporaryFolder folder;
  RunFolder lane(posix_env(), folder / "lane");
  ASSERT_OK(lane.save(a_run()));
  ASSERT_OK(lane.append("t,x,y,z,c\n1,2,3,4,25\n2,2,"));
  ASSERT_OK(lane.close());
  EXPECT_EQ((**lane.load()).resume.raw_csv, "t,x,y,z,c\n1,2,3,4,25\n");
}

// What the state says was measured on rows; without them the run is not gone on with. Rows that
// came behind the state may be lost.
TEST(RunFolder, ARunWhoseRowsAreNotAsTheyWereIsRefused) {
  const std::string rows = "t,x,y,z,c\n1,2,3,4,25\n";
  UnfinishedRun run = a_run();
  run.rows_bytes = rows.size();
  run.rows_sha256 = text_sha256(rows);
  run.retest = RetestState{1, 2, true, "a run", {}, 1};
  struct Row {
    std::string on_disk;
    bool good;
  };
  for (const Row& row :
       {Row{rows, true}, Row{rows + "2,2,3,4,25\n", true}, Row{rows + "2,2,", true},
        Row{"t,x,y,z,c\n", false}, Row{"", false}, Row{"t,x,y,z,c\n1,2,9,4,25\n", false},
        Row{"t,x,y,z,c\n" + std::string(11, '\0') + "\n", false}}) {
    SCOPED_TRACE(row.on_disk);
    const tests::TemporaryFolder folder;
    RunFolder lane(posix_env(), folder / "lane");
    ASSERT_OK(lane.append(row.on_disk));
    ASSERT_OK(lane.save(run));
    ASSERT_OK(lane.close());
    const auto left = lane.load();
    if (row.good) {
      ASSERT_OK(left);
      EXPECT_EQ((*left)->retest->passes_needed, 2);
      EXPECT_EQ((*left)->retest->failures_left, 1);
      EXPECT_EQ((*left)->retest->retest_of, "a run");
    } else {
      EXPECT_FAILS(left, ErrorCode::bad_data);
    }
  }
}

TEST(RunFolder, ADamagedStateIsRefusedAndSetAside) {
  const tests::TemporaryFolder folder;
  RunFolder lane(posix_env(), folder / "lane");
  ASSERT_OK(lane.save(a_run()));
  std::ofstream(folder / "lane/run.json") << R"({"device": "virtual:seed=7", "serial": 7})";
  EXPECT_FAILS(lane.load(), ErrorCode::bad_data);
  ASSERT_OK(lane.set_aside_run());
  const auto left = lane.load();
  ASSERT_OK(left);
  EXPECT_FALSE(left->has_value());
}

class NoNewNames final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status rename(const std::string& from, const std::string& to) override {
    return fails && from.ends_with("run.json")
               ? fail(ErrorCode::io, "the disk fails", to, "see to the disk")
               : ForwardingFiles::rename(from, to);
  }
  bool fails = true;
};

// A folder in which nothing can be renamed is not filled with reports of one run.
TEST(RunFolder, ARunThatCannotBeSetAsideHasOneReport) {
  MemoryEnv memory;
  NoNewNames files(memory.files);
  Env env{memory.clock, files};
  RunFolder lane(env, "lane");
  const auto reports = [&] {
    auto names = *memory.files.list("lane");
    std::erase_if(names, [](const std::string& name) { return !name.starts_with("report"); });
    return names;
  };
  ASSERT_OK(lane.save(a_run()));
  for (const char* text : {"first", "second"}) {
    EXPECT_FAILS(lane.set_aside_ended_run(text), ErrorCode::io);
    EXPECT_EQ(reports().size(), 1U);
    memory.clock.sleep(std::chrono::seconds(2));
  }
  files.fails = false;
  const auto path = lane.set_aside_ended_run("third");
  ASSERT_OK(path);
  EXPECT_EQ(reports().size(), 1U);
  const auto kept = read_file(files, *path, 100);
  ASSERT_OK(kept);
  EXPECT_EQ(std::string(kept->begin(), kept->end()), "third");
  EXPECT_FALSE(lane.load()->has_value());
  // The next run has a report of its own.
  ASSERT_OK(lane.save(a_run()));
  const auto next = lane.set_aside_ended_run("next");
  ASSERT_OK(next);
  EXPECT_NE(*next, *path);
  EXPECT_EQ(reports().size(), 2U);
}

TEST(RunFolder, ACaptureIsFoundWithTheSidesThatAreDone) {
  const tests::TemporaryFolder folder;
  RunFolder lane(posix_env(), folder / "lane");
  EXPECT_FALSE(lane.load_capture()->has_value());
  UnfinishedCapture capture;
  capture.serial = "MOS2A45130007";
  capture.output = "out.gt3x";
  capture.resume.done = {{device::Pose::plus_z, 3}, {device::Pose::minus_x, 4}};
  capture.resume.asked_again = 2;
  ASSERT_OK(lane.save_capture(capture));
  const std::string json = text_of_file(folder / "lane/capture.json");
  EXPECT_NE(json.find("\"-x\""), std::string::npos) << json;
  const auto left = lane.load_capture();
  ASSERT_OK(left);
  ASSERT_TRUE(left->has_value());
  ASSERT_EQ((*left)->resume.done.size(), 2U);
  EXPECT_EQ((*left)->resume.done[1].pose, CapturePose(device::Pose::minus_x));
  EXPECT_EQ((*left)->resume.done[1].recording, 4);
  EXPECT_EQ((*left)->resume.asked_again, 2);
  // An earlier version did not write it, and a later one not how often.
  auto old = nlohmann::ordered_json::parse(json);
  for (const bool is_asked : {true, false}) {
    old["asked_again"] = is_asked;
    std::ofstream(folder / "lane/capture.json") << old;
    EXPECT_EQ((*lane.load_capture())->resume.asked_again, is_asked ? 1 : 0);
  }
  old["asked_again"] = "twice";
  std::ofstream(folder / "lane/capture.json") << old;
  EXPECT_FAILS(lane.load_capture(), ErrorCode::bad_data);
  old.erase("asked_again");
  std::ofstream(folder / "lane/capture.json") << old;
  EXPECT_EQ((*lane.load_capture())->resume.asked_again, 0);
  ASSERT_OK(lane.clear_capture());
  EXPECT_FALSE(lane.load_capture()->has_value());
}

// The readings of `production` do not say how the unit lay: they are no part of a production+ run.
TEST(RunFolder, ARunOfAnotherProtocolIsNotGoneOnWith) {
  for (const JigProtocol protocol : {JigProtocol::production, JigProtocol::production_plus}) {
    const tests::TemporaryFolder place;
    RunFolder folder(posix_env(), place / "run");
    UnfinishedRun run = a_run();
    run.protocol = JigProtocol::production_plus;
    ASSERT_OK(folder.save(run));
    EXPECT_EQ((*folder.load())->protocol, JigProtocol::production_plus);
    run.protocol = protocol;
    RunSaver saver(folder, run, [](const std::string& warning) { ADD_FAILURE() << warning; });
    EXPECT_EQ(saver.take_left_over(false)->has_value(), protocol == JigProtocol::production_plus);
  }
}

// Five of six sides on J-1 and the sixth on J-2 are no run on either; nothing is lost by the
// refusal.
TEST(RunFolder, ARunThatWasBegunOnAnotherJigStaysUntilItIsNamedOrBegunAnew) {
  const tests::TemporaryFolder place;
  RunFolder folder(posix_env(), place / "run");
  UnfinishedRun run = a_run();
  run.operator_name = "Ada";
  run.is_authenticated = true;
  run.jig_id = "J-1";
  run.gravity_m_per_s2 = 9.81;
  ASSERT_OK(folder.save(run));
  const auto warn = [](const std::string& warning) { ADD_FAILURE() << warning; };
  UnfinishedRun now = run;
  now.operator_name = "Bo";
  now.is_authenticated = true;
  now.jig_id = "J-2";
  EXPECT_FAILS(RunSaver(folder, now, warn).take_left_over(false), ErrorCode::usage);
  now.jig_id = "J-1";
  RunSaver saver(folder, now, warn);
  const auto left = saver.take_left_over(false);
  ASSERT_OK(left);
  EXPECT_TRUE(left->has_value());
  EXPECT_EQ(saver.state().operator_name, "Ada, then Bo");
  EXPECT_TRUE(saver.state().is_authenticated);
  now.jig_id = "J-2";
  EXPECT_FALSE(RunSaver(folder, now, warn).take_left_over(true)->has_value());
}

}  // namespace
}  // namespace sixpoint::station
