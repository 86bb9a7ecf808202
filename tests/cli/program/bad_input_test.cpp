// Every bad recording, through every command that reads recordings: the contract's exit code, one
// clear line that says what to do, and no output file.
#include <algorithm>

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/made_recording.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {
using testing::HasSubstr;

using tests::MadeRecording;
using tests::run_command;

MadeRecording minute() {
  MadeRecording made;
  for (int i = 0; i < 1800; ++i) {
    made.raw.push_back({60 + i % 7, 4 - i % 5, 300});
  }
  return made;
}

class BadRecording : public testing::Test {
 protected:
  void put(const Bytes& bytes) {
    static_cast<void>(memory_.files.remove("in.gt3x"));
    auto file = memory_.files.create("in.gt3x");
    ASSERT_OK(file);
    ASSERT_OK((*file)->write_at(0, bytes));
  }
  Bytes good_zip() {
    EXPECT_OK(minute().write(memory_.files, "good.gt3x"));
    return read_file(memory_.files, "good.gt3x").value();
  }
  void put_entries(const std::vector<std::pair<std::string, Bytes>>& entries) {
    static_cast<void>(memory_.files.remove("in.gt3x"));
    auto writer = gt3x::RecordingWriter::create(memory_.files, "in.gt3x");
    ASSERT_OK(writer);
    for (const auto& [name, bytes] : entries) {
      ASSERT_OK(writer->add(name, bytes));
    }
    ASSERT_OK(writer->commit());
  }

  // Runs `arguments` on in.gt3x; nothing but in.gt3x and good.gt3x may be there afterwards, and in
  // the folder of outputs nothing but the list of what became of the files.
  void expect_refused(const std::vector<std::string>& arguments, int exit_code) {
    const auto answer = run_command(memory_.env, arguments);
    EXPECT_EQ(answer.exit_code, exit_code) << arguments[0] << ": " << answer.people << answer.out;
    // repair and scan give every input its own line on stdout, the others complain to people.
    const std::string said = answer.people + answer.out;
    EXPECT_NE(said.find("in.gt3x"), std::string::npos) << said;
    const auto names = memory_.files.list(".").value();
    EXPECT_THAT(names, testing::Each(testing::AnyOf("in.gt3x", "good.gt3x", "out")))
        << arguments[0];
    const auto out = memory_.files.list("out").value_or(std::vector<std::string>{});
    EXPECT_THAT(out, testing::Each(testing::AnyOf("manifest.csv", "manifest.json", "units.csv",
                                                  ".sixpoint-repair.lock")))
        << arguments[0];
  }
  void expect_all_refused(int exit_code) {
    expect_refused({"inspect", "in.gt3x"}, exit_code);
    expect_refused({"scan", "in.gt3x"}, exit_code);
    expect_refused({"export", "in.gt3x", "--csv", "out.csv"}, exit_code);
    expect_refused({"solve", "in.gt3x"}, exit_code);
    expect_refused({"repair", "in.gt3x", "-o", "out", "--scan"}, exit_code);
  }

  MemoryEnv memory_;
};

TEST_F(BadRecording, NotAZip) {
  put(Bytes(1000, 'x'));
  expect_all_refused(65);
  put({});
  expect_all_refused(65);
}

TEST_F(BadRecording, NoSuchFile) {
  expect_refused({"inspect", "in.gt3x"}, 66);
  expect_refused({"scan", "in.gt3x"}, 66);
  expect_refused({"export", "in.gt3x", "--csv", "out.csv"}, 66);
  expect_refused({"solve", "in.gt3x"}, 66);
  expect_refused({"repair", "in.gt3x", "-o", "out", "--scan"}, 66);
}

TEST_F(BadRecording, WithoutLog) {
  put_entries({{"info.txt", {'S', 'e', 'r', 'i', 'a', 'l', ':', ' ', '1'}}});
  expect_all_refused(65);
}

TEST_F(BadRecording, CutShortAnywhere) {
  const Bytes whole = good_zip();
  for (std::size_t size = 1; size < whole.size(); size += 1 + whole.size() / 40) {
    put(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
    expect_all_refused(65);
  }
}

TEST_F(BadRecording, DamagedEntry) {
  Bytes bytes = good_zip();
  bytes[bytes.size() / 2] ^= 1U;
  put(bytes);
  expect_all_refused(65);
}

TEST_F(BadRecording, EntriesNamedWithPaths) {
  // The names have the same length, so that only the bytes of the names change.
  Bytes bytes = good_zip();
  const std::string plain = "extra.bin";
  const std::string hostile = "../../x.y";
  for (auto at = std::search(bytes.begin(), bytes.end(), plain.begin(), plain.end());
       at != bytes.end(); at = std::search(at, bytes.end(), plain.begin(), plain.end())) {
    std::copy(hostile.begin(), hostile.end(), at);
  }
  put(bytes);
  expect_all_refused(65);
}

TEST_F(BadRecording, SampleRateOfZero) {
  MadeRecording made = minute();
  gt3x::Info info;
  info.set("Serial Number", made.serial);
  info.set("Firmware", made.firmware);
  info.set("Sample Rate", "0");
  const std::string text = info.serialise();
  put_entries({{"log.bin", made.log()}, {"info.txt", Bytes(text.begin(), text.end())}});
  expect_refused({"scan", "in.gt3x"}, 65);
  expect_refused({"solve", "in.gt3x"}, 65);
  expect_refused({"repair", "in.gt3x", "-o", "out", "--scan"}, 65);
  expect_refused({"export", "in.gt3x", "--csv", "out.csv"}, 65);
}

TEST_F(BadRecording, NoSamplesAtAll) {
  MadeRecording made = minute();
  made.raw.clear();
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  EXPECT_EQ(run_command(memory_.env, {"scan", "in.gt3x"}).exit_code, 1) << "the header says it";
  expect_refused({"inspect", "in.gt3x"}, 65);
  expect_refused({"export", "in.gt3x", "--csv", "out.csv"}, 65);
  expect_refused({"solve", "in.gt3x"}, 65);
  expect_refused({"repair", "in.gt3x", "-o", "out", "--scan"}, 65);
}

TEST_F(BadRecording, DamagedRecordsAreCountedAndTheRestIsUsed) {
  MadeRecording made = minute();
  Bytes garbage(50, 0x1E);
  made.between = [&](std::size_t second) { return second == 7 ? garbage : Bytes{}; };
  Bytes log = made.log();
  log[log.size() - 40] ^= 8U;  // inside the last sample record
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  const auto answer = run_command(memory_.env, {"inspect", "in.gt3x", "--json"});
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json()["checksum_failures"], 1);
  EXPECT_EQ(answer.json()["samples"], 59 * 30);
}

TEST_F(BadRecording, CommandLines) {
  EXPECT_EQ(run_command(memory_.env, {}).exit_code, 64);
  EXPECT_EQ(run_command(memory_.env, {"nonsense"}).exit_code, 64);
  EXPECT_EQ(run_command(memory_.env, {"scan", "--nonsense"}).exit_code, 64);
  EXPECT_EQ(run_command(memory_.env, {"repair", "in.gt3x"}).exit_code, 64) << "no -o";
  EXPECT_EQ(run_command(memory_.env, {"--help"}).exit_code, 0);
  EXPECT_EQ(run_command(memory_.env, {"station"}).exit_code, 64);
}

TEST_F(BadRecording, WhatIsMissingNamesTheHelpOfItsCommand) {
  EXPECT_THAT(run_command(memory_.env, {}).people, HasSubstr("'sixpoint --help'"));
  EXPECT_THAT(run_command(memory_.env, {"history"}).people,
              HasSubstr("serial is required; 'sixpoint history --help' lists"));
  EXPECT_THAT(run_command(memory_.env, {"store", "trend"}).people,
              HasSubstr("serial is required; 'sixpoint store trend --help' lists"));
}

// The table of plain_words() in suggestion.h, a row each.
TEST_F(BadRecording, WhyACommandLineIsRefusedInPlainWords) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> rows = {
      {{"repair", "a", "-o"}, "--output has no value;"},
      {{"repair", "a", "-o", "b", "-o", "c"}, "--output is given 2 times, and is taken once;"},
      {{"compare", "a"}, "RECORDING: at least 2 are needed, 1 is given;"},
      {{"repair", "a", "-o", "b", "--jobs", "abc"}, "--jobs: 'abc' is no number from 0 to 256;"},
      {{"export", "a", "--csv", "b", "--imu", "--raw"}, "--raw and --imu do not go together;"},
      {{"inspect", "a", "b"}, "more arguments than it takes: b;"},
      {{"gap", "challenge", "--seed", "x"}, "--seed cannot be 'x';"},
      {{"archive"}, "a command is missing; 'sixpoint archive --help' lists"},
      {{"history"}, "serial is required;"}};
  for (const auto& [arguments, words] : rows) {
    EXPECT_THAT(run_command(memory_.env, arguments).people, HasSubstr("sixpoint: " + words));
  }
}

}  // namespace
}  // namespace sixpoint::cli
