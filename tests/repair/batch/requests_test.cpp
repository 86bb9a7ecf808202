#include "repair/batch/requests.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "repair/archive/output_lock.h"
#include "repair/batch/reading.h"
#include "repair/batch/stoppable_files.h"
#include "repair/made_agdc.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {
namespace {

TEST(Requests, TakeTheirOptionsAndNoOthers) {
  RepairRequest request;
  ASSERT_OK(
      take_options(R"({"scan": true, "jobs": 3, "constants": "C.json", "wide": true})", request));
  EXPECT_TRUE(request.scan);
  EXPECT_TRUE(request.repair.wide);
  EXPECT_EQ(request.jobs, 3U);
  EXPECT_EQ(request.constants, "C.json");
  EXPECT_FALSE(request.or_scan);
  for (const char* wrong :
       {R"({"widee": true})", R"({"wide": 1})", R"({"jobs": -1})", R"({"jobs": 4294967296})",
        R"({"jobs": 257})", R"({"jobs": 1.5})", R"({"link_unaffected": "none"})",
        R"({"link_unaffected": 1})", "[]", "{"}) {
    RepairRequest other;
    EXPECT_FAILS(take_options(wrong, other), ErrorCode::usage);
  }
  ASSERT_OK(take_options(R"({"link_unaffected": "symbolic"})", request));
  EXPECT_EQ(request.link_unaffected, LinkKind::symbolic);
  ASSERT_OK(take_parsed_options({{"constants", "\xff.json"}, {"link_unaffected", ""}}, request));
  EXPECT_EQ(request.constants, "\xff.json") << "a name that is no UTF-8";
  ScanRequest scan;
  EXPECT_FAILS(take_options(R"({"wide": true})", scan), ErrorCode::usage);
}

TEST(Requests, OfAScanAnswerForEveryFile) {
  MemoryEnv memory;
  ASSERT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", gt3x::tests::made_log(3)));
  const auto answer = run_scan(memory.env, {{"a.gt3x", "nowhere.gt3x"}, "", 2});
  ASSERT_OK(answer);
  EXPECT_EQ((*answer)["files"].size(), 2U);
  EXPECT_EQ((*answer)["files"][0]["verdict"], "affected");
  EXPECT_EQ((*answer)["files"][1]["verdict"], "unreadable");
  EXPECT_EQ((*answer)["summary"]["unreadable"], 1);
}

TEST(Requests, OfARepairNameTheConstantsThatAreMissing) {
  MemoryEnv memory;
  RepairRequest request;
  request.paths = {"a.gt3x"};
  request.folder = "out";
  request.constants = "nowhere.json";
  EXPECT_FAILS(run_repair(memory.env, request), ErrorCode::no_input);
  request.constants.clear();
  request.scan = true;
  const auto answer = run_repair(memory.env, request);
  ASSERT_OK(answer);
  EXPECT_EQ((*answer)["files"][0]["status"], "failed");
  EXPECT_EQ((*answer)["summary"]["failed"], 1);
}

TEST(Requests, OfARepairAreRefusedWhereAnotherRunIsAtWork) {
  MemoryEnv memory;
  ASSERT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", gt3x::tests::made_log(3)));
  RepairRequest request;
  request.paths = {"a.gt3x"};
  request.folder = "out";
  request.scan = true;
  const auto at_work = lock_for_repair(memory.files, "out");
  ASSERT_OK(at_work);
  EXPECT_FAILS(run_repair(memory.env, request), ErrorCode::cannot_create);
  request.repair.dry_run = true;
  EXPECT_OK(run_repair(memory.env, request)) << "it writes nothing";
}

TEST(Requests, ThatAreStoppedReadNothingMore) {
  MemoryEnv memory;
  ASSERT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", gt3x::tests::made_log(3)));
  std::atomic<bool> stop{false};
  StoppableFiles files(memory.files, stop);
  const auto file = files.open("a.gt3x");
  ASSERT_OK(file);
  Bytes bytes(4);
  EXPECT_OK((*file)->read_at(0, bytes));
  stop = true;
  EXPECT_FAILS((*file)->read_at(0, bytes), ErrorCode::io);
  // Files that no thread had begun have no verdict.
  const auto nothing = [](std::size_t) {};
  EXPECT_FAILS(run_scan(memory.env, {{"a.gt3x"}, "", 1}, {nothing, &stop}), ErrorCode::io);
}

TEST(Reading, SaysTheScaleOfAnAgdcWhereItHasOne) {
  for (const bool calibrated : {false, true}) {
    MemoryEnv memory;
    tests::MadeAgdc made;
    made.calibrated = calibrated;
    ASSERT_OK(made.write(memory.files, "a.agdc"));
    auto recording = gt3x::Recording::open(memory.files, "a.agdc");
    ASSERT_OK(recording);
    auto stream = gt3x::SampleStream::open(*recording, {});
    ASSERT_OK(stream);
    ASSERT_OK(gt3x::read_all_rows(*stream, gt3x::RowValue::g_float32));
    const auto reading = reading_of(*recording, *stream);
    const auto inspection = inspect(memory.files, "a.agdc");
    ASSERT_OK(reading);
    ASSERT_OK(inspection);
    EXPECT_EQ(reading->accel_scale_lsb_per_g,
              calibrated ? std::optional<double>(256) : std::nullopt);
    EXPECT_EQ(reading->accel_scale_lsb_per_g, inspection->accel_scale_lsb_per_g);
    EXPECT_EQ(reading->constants, inspection->constants);
  }
}

// What a reading tells of its file is what inspect() tells of it.
TEST(Reading, SaysWhatInspectSays) {
  Bytes log = gt3x::tests::made_log(3);
  gt3x::tests::append_second(log, 5, 31);
  gt3x::append_record(log, gt3x::RecordType::activity, gt3x::tests::kStart + 6, Bytes{0});
  gt3x::tests::append_second(log, 12);
  gt3x::tests::append_second(log, 10'000);  // the clock leaps
  gt3x::tests::append_second(log, 20);      // and is set back
  for (const bool fill : {true, false}) {
    MemoryEnv memory;
    ASSERT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", log));
    auto recording = gt3x::Recording::open(memory.files, "a.gt3x");
    ASSERT_OK(recording);
    auto stream = gt3x::SampleStream::open(*recording, {true, fill});
    ASSERT_OK(stream);
    ASSERT_OK(gt3x::read_all_rows(*stream, gt3x::RowValue::lsb_int16));
    const auto reading = reading_of(*recording, *stream);
    const auto inspection = inspect(memory.files, "a.gt3x");
    ASSERT_OK(reading);
    ASSERT_OK(inspection);
    const Json ours = inspection_to_json(*reading, "a.gt3x");
    const Json theirs = inspection_to_json(*inspection, "a.gt3x");
    for (const char* key : {"form",
                            "serial",
                            "firmware",
                            "model",
                            "sample_rate_hz",
                            "accel_scale_lsb_per_g",
                            "clock",
                            "start",
                            "duration_s",
                            "irregular",
                            "samples",
                            "records",
                            "constants",
                            "calibration_time",
                            "filter",
                            "gaps",
                            "gap_count",
                            "gap_seconds",
                            "checksum_failures",
                            "damage",
                            "already_repaired",
                            "entries"}) {
      EXPECT_EQ(ours[key], theirs[key]) << key << fill;
    }
  }
}

// PARAMETERS that stand elsewhere than units write them: all who name constants name the same ones.
TEST(Reading, NamesTheParametersThatScanInspectAndRepairName) {
  using namespace gt3x::tests;
  const StoredConstants first = {{300, 300, 300}, {-210, -210, -210}, {40, 40, 40}};
  const StoredConstants second = {{310, 310, 310}, {-220, -220, -220}, {50, 50, 50}};
  const auto add = [](Bytes& log, gt3x::ParameterValues values, std::uint32_t calibrated) {
    values[gt3x::kParameterCalibrationTime] = calibrated;
    gt3x::append_record(log, gt3x::RecordType::parameters, kStart - 1,
                        gt3x::encode_parameters(values));
  };
  gt3x::ParameterValues some = made_parameters(first);
  some.erase({gt3x::kParameterUnitSpace, gt3x::kParameterZero});
  gt3x::ParameterValues others = some;
  others[{gt3x::kParameterUnitSpace, gt3x::kParameterPositive}] = 400;
  Bytes behind;  // the first sample has none before it
  append_second(behind, 0);
  add(behind, made_parameters(first), 1'384'266'733);
  Bytes two;  // the later one holds
  add(two, made_parameters(first), 1'384'000'000);
  add(two, made_parameters(second), 1'384'266'733);
  Bytes incomplete;  // the constants of the first, the date of the second
  add(incomplete, made_parameters(first), 1'384'000'000);
  add(incomplete, some, 1'384'266'733);
  Bytes contradicted;
  add(contradicted, made_parameters(first), 1'384'000'000);
  add(contradicted, others, 1'384'266'733);
  for (auto& [log, constants] : {std::pair<Bytes&, std::optional<StoredConstants>>{behind, first},
                                 {two, second},
                                 {incomplete, first},
                                 {contradicted, std::nullopt}}) {
    append_second(log, 1);
    MemoryEnv memory;
    ASSERT_OK(put_recording(memory.files, "a.gt3x", log));
    auto recording = gt3x::Recording::open(memory.files, "a.gt3x");
    ASSERT_OK(recording);
    auto stream = gt3x::SampleStream::open(*recording, {true, true});
    ASSERT_OK(stream);
    ASSERT_OK(gt3x::read_all_rows(*stream, gt3x::RowValue::lsb_int16));
    const auto reading = reading_of(*recording, *stream);
    const auto inspection = inspect(memory.files, "a.gt3x");
    const auto surveyed = survey(memory.files, "a.gt3x");
    ASSERT_OK(reading);
    ASSERT_OK(inspection);
    ASSERT_OK(surveyed);
    for (const Inspection& found : {*reading, *inspection}) {
      EXPECT_EQ(found.constants, constants);
      EXPECT_EQ(found.facts.calibration_time, from_unix_seconds(1'384'266'733));
      EXPECT_EQ(found.accel_scale_lsb_per_g, 256);
    }
    EXPECT_EQ(surveyed->facts.calibration_time, from_unix_seconds(1'384'266'733));
    EXPECT_EQ(surveyed->constants_problem.has_value(), !constants);
    if (constants) {
      ASSERT_FALSE(surveyed->constants.empty());
      EXPECT_EQ(surveyed->constants.front(), *constants) << "undone in the first samples";
    }
  }
}

}  // namespace
}  // namespace sixpoint::repair
