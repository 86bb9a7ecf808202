// sixpoint export by its contract: the CSV, and what it never writes over.
#include <gmock/gmock.h>
#include <zlib.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording_writer.h"
#include "gt3x_made_log.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {

using gt3x::tests::made_log;
using gt3x::tests::put_recording;
using tests::run_command;

TEST(Export, WritesWholeFilesAndNeverOverARecording) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  ASSERT_OK(put_recording(memory.files, "other.gt3x", made_log(1)));
  const Bytes original = *read_file(memory.files, "f.gt3x");
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "f.gt3x"}).exit_code, 73);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "other.gt3x"}).exit_code, 73);
  EXPECT_EQ(*read_file(memory.files, "f.gt3x"), original);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "out.csv"}).exit_code, 0);
  const Bytes csv = *read_file(memory.files, "out.csv");
  const auto standard = run_command(memory.env, {"export", "f.gt3x", "--csv", "-"});
  EXPECT_EQ(standard.out, std::string(csv.begin(), csv.end()));
  memory.files.fail_after(2);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "late.csv"}).exit_code, 74);
  memory.files.stop_failing();
  EXPECT_FALSE(memory.files.info("late.csv"));
}

TEST(Export, WritesTheRecordsOfOneType) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  const auto lux = run_command(memory.env, {"export", "f.gt3x", "--records", "LUX", "--csv", "-"});
  EXPECT_EQ(lux.exit_code, 0);
  EXPECT_EQ(
      lux.out,
      "time,unix_s,lux\n2015-04-09T14:04:00,1428588240,7\n2015-04-09T14:04:01,1428588241,7\n");
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--records", "5", "--csv", "-"}).out,
            lux.out);
  const auto unknown =
      run_command(memory.env, {"export", "f.gt3x", "--records", "LIGHT", "--csv", "a.csv"});
  EXPECT_EQ(unknown.exit_code, 64);
  EXPECT_THAT(unknown.people, testing::HasSubstr("BATTERY"));
  EXPECT_FALSE(memory.files.info("a.csv"));
  EXPECT_EQ(
      run_command(memory.env, {"export", "f.gt3x", "--records", "LUX", "--imu", "--csv", "a.csv"})
          .exit_code,
      64);
}

TEST(Export, ARecordingWithoutTheInertialSensorIsRefused) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  const auto imu = run_command(memory.env, {"export", "f.gt3x", "--imu", "--csv", "a.csv"});
  EXPECT_EQ(imu.exit_code, 65);
  EXPECT_THAT(imu.people, testing::HasSubstr("SENSOR_SCHEMA"));
  EXPECT_FALSE(memory.files.info("a.csv"));
}

std::vector<std::string> lines_of_csv(const std::string& text) {
  std::vector<std::string> lines;
  for (const std::string_view line : lines_of(text)) {
    lines.emplace_back(line);
    while (!lines.back().empty() && lines.back().back() == '\r') {
      lines.back().pop_back();
    }
  }
  return lines;
}

// made_log: seconds of samples from gt3x::tests::kStart on.
TEST(Export, TimesStandInTheFirstColumn) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  const auto lines = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"export", "f.gt3x", "--csv", "-"});
    return lines_of_csv(run_command(memory.env, more).out);
  };
  const auto plain = lines({});
  const auto iso = lines({"--time"});
  const auto seconds = lines({"--time=seconds"});
  const auto unix_time = lines({"--unix"});
  ASSERT_EQ(iso.size(), plain.size());
  EXPECT_EQ(iso[10], "Timestamp," + plain[10]);
  EXPECT_EQ(seconds[10], "Seconds," + plain[10]);
  EXPECT_EQ(unix_time[10], "Unix Timestamp," + plain[10]);
  const std::string start = std::to_string(gt3x::tests::kStart);
  EXPECT_EQ(unix_time[11], start + ".000," + plain[11]);
  EXPECT_EQ(unix_time[12], start + ".033," + plain[12]) << "30 Hz";
  EXPECT_EQ(unix_time[11 + 3], start + ".100," + plain[11 + 3]);
  EXPECT_EQ(unix_time[11 + 29], start + ".966," + plain[11 + 29]);
  EXPECT_EQ(seconds[11 + 30], "1.000," + plain[11 + 30]);
  const std::string first = to_iso8601(from_unix_seconds(gt3x::tests::kStart));
  EXPECT_EQ(iso[11 + 3], first.substr(0, 19) + ".100," + plain[11 + 3]);
  EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "-", "--time=day"}).exit_code,
            64);
  Bytes utc = {};
  append_record(utc, gt3x::RecordType::metadata, gt3x::tests::kStart,
                as_bytes(std::string_view(R"({"MetadataType":"LocalTimeLog","UsedUtc":true})")));
  gt3x::tests::append_second(utc, 0);
  ASSERT_OK(put_recording(memory.files, "f.gt3x", utc));
  EXPECT_EQ(lines({"--time"})[11 + 3].substr(0, 24), first.substr(0, 19) + ".100Z");
}

// Two hours are missing, for no reason that the file has.
TEST(Export, TheFillLimitSaysHowMuchIsFilled) {
  MemoryEnv memory;
  Bytes log = made_log(2);
  gt3x::tests::append_second(log, 7202);
  ASSERT_OK(put_recording(memory.files, "f.gt3x", log));
  const auto lines = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"export", "f.gt3x", "--csv", "-"});
    return run_command(memory.env, more);
  };
  const auto usual = lines({});
  EXPECT_EQ(lines_of_csv(usual.out).size(), 11U + 90);
  EXPECT_THAT(usual.people, testing::HasSubstr("--fill-limit 7200 fills it"));
  const auto filled = lines({"--fill-limit", "7200"});
  EXPECT_EQ(lines_of_csv(filled.out).size(), 11U + 7203 * 30);
  EXPECT_THAT(filled.people, testing::Not(testing::HasSubstr("leaps")));
  EXPECT_EQ(lines({"--fill-limit", "-1"}).exit_code, 64);
  EXPECT_EQ(lines({"--fill-limit", "day"}).exit_code, 64);
  EXPECT_EQ(lines({"--fill-limit", "60", "--no-fill"}).exit_code, 64);
}

TEST(Export, WritesAnArray) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(2)));
  ASSERT_EQ(run_command(memory.env, {"export", "f.gt3x", "-o", "out", "--format", "npy"}).exit_code,
            0);
  const auto one = run_command(memory.env, {"export", "f.gt3x", "--csv", "-", "--format", "npy"});
  const Bytes array = read_file(memory.files, "out/f.npy").value();
  EXPECT_EQ(one.out, std::string(array.begin(), array.end()));
  EXPECT_THAT(one.out, testing::HasSubstr("'descr': '<f4'"));
  EXPECT_EQ(one.out.size(), 128U + 60 * 3 * 4);
  for (const char* other : {"--time", "--unix", "--imu"}) {
    EXPECT_EQ(run_command(memory.env, {"export", "f.gt3x", "--csv", "-", "--format", "npy", other})
                  .exit_code,
              64)
        << other;
  }
  EXPECT_EQ(
      run_command(memory.env, {"export", "f.gt3x", "--csv", "-", "--format", "parquet"}).exit_code,
      64);
}

TEST(Export, SeveralRecordingsGoIntoAFolder) {
  MemoryEnv memory;
  ASSERT_OK(memory.files.make_folders("in/deep"));
  ASSERT_OK(put_recording(memory.files, "in/a.gt3x", made_log(1)));
  ASSERT_OK(put_recording(memory.files, "in/deep/b.gt3x", made_log(2)));
  ASSERT_OK(write_file(memory.files, "in/broken.gt3x", "no zip"));
  const auto answer = run_command(memory.env, {"export", "in", "-o", "out"});
  EXPECT_EQ(answer.exit_code, 65) << "one of them cannot be read";
  EXPECT_THAT(answer.people, testing::HasSubstr("broken.gt3x"));
  const auto one = run_command(memory.env, {"export", "in/deep/b.gt3x", "--csv", "-"});
  const Bytes b = read_file(memory.files, "out/deep/b.csv").value();
  EXPECT_EQ(std::string(b.begin(), b.end()), one.out);
  EXPECT_TRUE(memory.files.info("out/a.csv"));
  EXPECT_FALSE(memory.files.info("out/broken.csv"));
  EXPECT_EQ(run_command(memory.env, {"export", "in/a.gt3x", "-o", "out"}).exit_code, 73);
  EXPECT_EQ(run_command(memory.env, {"export", "in/a.gt3x"}).exit_code, 64);
  EXPECT_EQ(run_command(memory.env, {"export", "in", "in/a.gt3x", "--csv", "x.csv"}).exit_code, 64);
  ASSERT_OK(put_recording(memory.files, "a.gt3x", made_log(3)));
  const auto same = run_command(memory.env, {"export", "in/a.gt3x", "a.gt3x", "-o", "twice"});
  EXPECT_EQ(same.exit_code, 73);
  EXPECT_TRUE(memory.files.info("twice/a.csv"));
  const auto one_twice = run_command(memory.env, {"export", "a.gt3x", "a.gt3x", "-o", "once"});
  EXPECT_EQ(one_twice.exit_code, 0) << "a file that is named twice is taken once";
}

// Oracle: zlib.
TEST(Export, GzipHoldsTheSameText) {
  MemoryEnv memory;
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(5)));
  ASSERT_EQ(run_command(memory.env, {"export", "f.gt3x", "-o", "out", "--gzip"}).exit_code, 0);
  const auto plain = run_command(memory.env, {"export", "f.gt3x", "--csv", "-"});
  Bytes packed = read_file(memory.files, "out/f.csv.gz").value();
  z_stream state{};
  ASSERT_EQ(inflateInit2(&state, 15 + 16), Z_OK);
  std::string text(plain.out.size() + 1, ' ');
  state.next_in = packed.data();
  state.avail_in = static_cast<uInt>(packed.size());
  state.next_out = reinterpret_cast<Bytef*>(text.data());
  state.avail_out = static_cast<uInt>(text.size());
  EXPECT_EQ(inflate(&state, Z_FINISH), Z_STREAM_END);
  text.resize(state.total_out);
  inflateEnd(&state);
  EXPECT_TRUE(text == plain.out);
}

TEST(Export, ARepairedRecordingIsNotCalledTheVendors) {
  MemoryEnv memory;
  auto writer = gt3x::RecordingWriter::create(memory.files, "marked.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made_log(1)));
  ASSERT_OK(writer.add("info.txt", std::string_view(gt3x::tests::made_info())));
  ASSERT_OK(writer.add("sixpoint-repair.json", std::string_view("{}")));
  ASSERT_OK(writer.commit());
  ASSERT_OK(put_recording(memory.files, "f.gt3x", made_log(1)));
  const auto first_line = [&](const char* path) {
    return lines_of_csv(run_command(memory.env, {"export", path, "--csv", "-"}).out).front();
  };
  EXPECT_THAT(first_line("f.gt3x"), testing::HasSubstr("Created By ActiGraph GT3X+ ActiLife"));
  EXPECT_THAT(first_line("marked.gt3x"), testing::HasSubstr("Created By sixpoint "));
  EXPECT_THAT(first_line("marked.gt3x"), testing::HasSubstr("repaired recording Firmware v"));
}

}  // namespace
}  // namespace sixpoint::cli
