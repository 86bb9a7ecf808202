// docs/protocol.md as an outside reader takes it: a decoder and a unit in Python, written from the
// page alone (protocol_oracle.py, protocol_unit.py), against device/.
#include <array>
#include <cstdio>
#include <deque>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "device/session/session_recorder.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/faults/fault_plan.h"
#include "mocks/in_process/in_process.h"
#include "skip_unless.h"
#include "temporary_folder.h"

namespace sixpoint::device {
namespace {

using std::chrono::nanoseconds;
using std::chrono::seconds;
using testing::IsEmpty;

const std::string kFolder = SIXPOINT_SOURCE_DIR "/tests/device/wire/";

bool has_python() { return std::system("python3 -c 'import zlib' 2>/dev/null") == 0; }

std::string hex(std::span<const std::uint8_t> bytes) { return bytes.empty() ? "-" : to_hex(bytes); }

// The oracle's word for a transfer, by device/wire/protocol.h.
std::string word_for(const SessionTransfer& transfer) {
  if (transfer.kind == SessionTransfer::Kind::reopened) {
    return "reopened";
  }
  if (transfer.bytes.empty()) {
    return transfer.kind == SessionTransfer::Kind::to_device ? "out" : "in";
  }
  if (transfer.channel == SessionChannel::bulk) {
    const auto block = decode_bulk(transfer.bytes);
    return block ? fmt::format("block {} {} {} {}", block->recording, block->last ? 1 : 0,
                               block->offset, to_hex(sha256(block->content)))
                 : "damaged block";
  }
  const auto message = decode(transfer.bytes);
  if (!message) {
    return "damaged";
  }
  constexpr std::array<const char*, 4> kKinds = {"", "request", "reply", "samples"};
  return fmt::format("{} {} {} {} {}", kKinds[static_cast<std::size_t>(message->kind)],
                     message->sequence, static_cast<int>(message->command),
                     static_cast<int>(message->code), hex(message->payload));
}

// What it understood, and its exit code.
std::pair<nlohmann::json, int> ask_oracle(const std::string& session) {
  const std::string command = "python3 " + kFolder + "protocol_oracle.py " + session;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::string text;
  std::array<char, 4096> part{};
  for (std::size_t count = 0; (count = std::fread(part.data(), 1, part.size(), pipe)) > 0;) {
    text.append(part.data(), count);
  }
  const int exit_code = WEXITSTATUS(::pclose(pipe));
  return {nlohmann::json::parse(text, nullptr, false), exit_code};
}

class ProtocolOracle : public testing::Test {
 protected:
  void SetUp() override {
    SIXPOINT_SKIP_UNLESS(has_python(), "python3 is missing; install the Debian package python3");
  }
  // A session of everything that a station asks a unit for, with these faults on the way.
  Session record(const std::string& faults) {
    auto plan =
        mocks::parse_fault_plan(R"({"schema": "sixpoint/faults/1", "faults": [)" + faults + "]}");
    EXPECT_OK(plan);
    mocks::VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    const auto clock = std::make_shared<ManualClock>();
    Link link = mocks::link_to(
        std::make_shared<mocks::PluggedUnit>(options, *std::move(plan), clock), false);
    SessionRecorder recorder;
    EXPECT_OK(recorder.begin(posix_env().files, path_));
    recorder.attach(link);
    {
      const auto unit = *WireUnit::open(std::move(link));
      const auto page = unit->read_calibration();
      EXPECT_OK(page);
      EXPECT_OK(unit->set_filter(FilterConfiguration::current));
      EXPECT_OK(unit->start_stream(100));
      for (int i = 0; i < 60; ++i) {
        EXPECT_OK(unit->next_samples(seconds(1)));
      }
      statistics_ = unit->stream_statistics();
      EXPECT_OK(unit->stop_stream());
      written_ = {{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                  from_unix_seconds(1'600'000'000)};
      EXPECT_OK(unit->write_calibration(written_));
      EXPECT_OK(unit->start_recording(100, from_unix_seconds(1'500'000'000)));
      clock->sleep(seconds(300));
      EXPECT_OK(unit->stop_recording());
      recording_ = unit->recordings()->back();
      EXPECT_OK(unit->download(recording_, posix_env().files, folder_ / "all.gt3x"));
    }
    EXPECT_OK(recorder.finish());
    return *read_session(posix_env().files, path_);
  }

  const tests::TemporaryFolder folder_;
  const std::string path_ = folder_ / "session.zip";
  StreamStatistics statistics_;
  CalibrationPage written_;
  RecordingInfo recording_;
};

TEST_F(ProtocolOracle, UnderstandsASessionAsTheStationDoes) {
  const Session session = record("");
  const auto [json, exit_code] = ask_oracle(path_);
  ASSERT_TRUE(json.is_object());
  EXPECT_EQ(exit_code, 0);
  EXPECT_THAT(json["trouble"], IsEmpty()) << json["trouble"];
  ASSERT_EQ(json["transfers"].size(), session.transfers.size());
  for (std::size_t i = 0; i < session.transfers.size(); ++i) {
    EXPECT_EQ(json["transfers"][i], word_for(session.transfers[i])) << "transfer " << i;
  }
  const auto truth = sim::draw_unit(7);
  EXPECT_EQ(json["identity"]["serial"], truth.serial);
  EXPECT_EQ(json["identity"]["firmware"], truth.firmware);
  EXPECT_EQ(json["stream"]["samples"], statistics_.samples);
  EXPECT_EQ(json["stream"]["lost"], 0);
  // What the page holds after the write.
  EXPECT_EQ(json["constants"]["zero_lsb"], written_.constants.zero_lsb);
  EXPECT_EQ(json["constants"]["positive_lsb"], written_.constants.positive_lsb);
  EXPECT_EQ(json["constants"]["negative_lsb"], written_.constants.negative_lsb);
  EXPECT_EQ(json["constants"]["calibrated"], "2020-09-13T12:26:40Z");
  EXPECT_EQ(json["download"]["sha256"], to_hex(recording_.sha256));
  EXPECT_EQ(json["recordings"]["1"]["sha256"], to_hex(recording_.sha256));
  EXPECT_EQ(json["wrong_blocks"], 0);
}

// On a bad cable: both drop the same transfers and count the same losses.
TEST_F(ProtocolOracle, DropsWhatTheStationDrops) {
  const Session session = record(
      R"({"fault": "bad_crc", "of": "samples", "at_report": 5, "every": 11},
         {"fault": "bit_flip", "of": "samples", "at_report": 8, "every": 13},
         {"fault": "duplicate", "of": "samples", "at_report": 3, "every": 9},
         {"fault": "lost", "of": "samples", "at_report": 7, "every": 10},
         {"fault": "wrong_sequence", "of": "samples", "at_report": 4, "every": 17},
         {"fault": "bad_crc", "of": "replies", "at_report": 4, "every": 9},
         {"fault": "duplicate", "of": "replies", "at_report": 6, "every": 7},
         {"fault": "bit_flip", "channel": "bulk", "at_report": 2, "byte": 300})");
  const auto [json, exit_code] = ask_oracle(path_);
  ASSERT_TRUE(json.is_object());
  EXPECT_EQ(exit_code, 0);
  EXPECT_THAT(json["trouble"], IsEmpty()) << json["trouble"];
  for (std::size_t i = 0; i < session.transfers.size(); ++i) {
    EXPECT_EQ(json["transfers"][i], word_for(session.transfers[i])) << "transfer " << i;
  }
  EXPECT_EQ(json["stream"]["samples"], statistics_.samples);
  EXPECT_EQ(json["stream"]["lost"], statistics_.lost_samples);
  EXPECT_EQ(json["stream"]["duplicates"], statistics_.duplicate_reports);
  EXPECT_GT(statistics_.lost_samples, 50U);
  EXPECT_GT(statistics_.duplicate_reports, 4U);
  EXPECT_GT(json["damaged"], 10);
  EXPECT_GT(json["late"], 2);
  EXPECT_GT(json["repeats"], 2);
  EXPECT_EQ(json["download"]["sha256"], to_hex(recording_.sha256)) << "out of good blocks alone";
}

// A unit in another process, at the other end of two pipes.
class PipedUnit {
 public:
  PipedUnit() {
    ::signal(SIGPIPE, SIG_IGN);  // its end is an error of a write
    std::array<int, 2> in{};
    std::array<int, 2> out{};
    if (::pipe2(in.data(), O_CLOEXEC) != 0 || ::pipe2(out.data(), O_CLOEXEC) != 0) {
      return;
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, in[0], 0);
    posix_spawn_file_actions_adddup2(&actions, out[1], 1);
    std::string python = "python3";
    std::string no_bytecode = "-B";  // nothing is left in the source folder
    std::string script = kFolder + "protocol_unit.py";
    std::array<char*, 4> arguments = {python.data(), no_bytecode.data(), script.data(), nullptr};
    if (::posix_spawnp(&child_, "python3", &actions, nullptr, arguments.data(), environ) != 0) {
      child_ = -1;
    }
    posix_spawn_file_actions_destroy(&actions);
    ::close(in[0]);
    ::close(out[1]);
    to_ = ::fdopen(in[1], "wb");
    from_ = ::fdopen(out[0], "rb");
  }
  PipedUnit(const PipedUnit&) = delete;
  PipedUnit& operator=(const PipedUnit&) = delete;
  ~PipedUnit() {
    std::fclose(to_);  // its end
    std::fclose(from_);
    int status = 0;
    ::waitpid(child_, &status, 0);
  }

  // Gives it a report and takes all that it says to that.
  Status tell(std::span<const std::uint8_t> report) {
    std::fwrite(report.data(), 1, report.size(), to_);
    std::fflush(to_);
    for (;;) {
      std::array<std::uint8_t, 5> head{};
      if (std::fread(head.data(), 1, head.size(), from_) != head.size()) {
        return fail(ErrorCode::device_unavailable, "the unit in Python ended", {}, "look above");
      }
      if (head[0] == 'E') {
        return {};
      }
      Bytes content(static_cast<std::size_t>(head[1] | head[2] << 8 | head[3] << 16));
      if (std::fread(content.data(), 1, content.size(), from_) != content.size()) {
        return fail(ErrorCode::device_unavailable, "the unit in Python ended", {}, "look above");
      }
      (head[0] == 'B' ? blocks : reports).push_back(std::move(content));
    }
  }

  std::deque<Bytes> reports;
  std::deque<Bytes> blocks;

 private:
  pid_t child_ = -1;
  FILE* to_ = nullptr;
  FILE* from_ = nullptr;
};

class Pipe final : public Transport {
 public:
  Pipe(std::shared_ptr<PipedUnit> unit, std::shared_ptr<Clock> clock, bool bulk)
      : unit_(std::move(unit)), clock_(std::move(clock)), bulk_(bulk) {}
  Status write(std::span<const std::uint8_t> bytes, nanoseconds /*time_out*/) override {
    return unit_->tell(bytes);
  }
  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    std::deque<Bytes>& waiting = bulk_ ? unit_->blocks : unit_->reports;
    if (waiting.empty() && !bulk_) {
      SIXPOINT_CHECK(unit_->tell(Report{}));  // time passes: a report of samples, where it streams
      clock_->sleep(std::chrono::milliseconds(60));
    }
    if (waiting.empty()) {
      clock_->sleep(time_out);
      return 0;
    }
    const Bytes next = std::move(waiting.front());
    waiting.pop_front();
    const std::size_t count = std::min(out.size(), next.size());
    std::copy_n(next.begin(), count, out.begin());
    return count;
  }
  void cancel() override {}

 private:
  std::shared_ptr<PipedUnit> unit_;
  std::shared_ptr<Clock> clock_;
  bool bulk_;
};

class UnitInPython : public ProtocolOracle {
 protected:
  void SetUp() override {
    ProtocolOracle::SetUp();
    if (IsSkipped()) {
      return;
    }
    clock_ = std::make_shared<ManualClock>();
    piped_ = std::make_shared<PipedUnit>();
  }
  Link link() {
    Link link;
    link.address = "python:";
    link.clock = clock_;
    link.reports = std::make_unique<Pipe>(piped_, clock_, false);
    link.bulk = std::make_unique<Pipe>(piped_, clock_, true);
    return link;
  }
  // The code of the reply to a request that the station would never send.
  ReplyCode code_for(Command command, Bytes payload) {
    piped_->reports.clear();
    const Report report =
        encode({ReportKind::request, ++sequence_, command, ReplyCode::ok, std::move(payload)});
    EXPECT_OK(piped_->tell(report));
    EXPECT_EQ(piped_->reports.size(), 1U);
    const auto reply = decode(piped_->reports.at(0));
    EXPECT_OK(reply);
    EXPECT_EQ(reply->sequence, sequence_);
    EXPECT_EQ(reply->command, command);
    return reply->code;
  }
  std::shared_ptr<ManualClock> clock_;
  std::shared_ptr<PipedUnit> piped_;
  std::uint16_t sequence_ = 100;
};

// The page is enough to write a unit that the station works with.
TEST_F(UnitInPython, IsCalibratedStreamsRecordsAndIsDownloaded) {
  const auto opened = WireUnit::open(link());
  ASSERT_OK(opened);
  Unit& unit = **opened;
  EXPECT_EQ(unit.identity().serial, "PYTHON00001");
  EXPECT_EQ(unit.identity().battery_mv, 4000);
  const auto page = unit.read_calibration();
  ASSERT_OK(page);
  EXPECT_EQ(page->constants, (StoredConstants{{266, 267, 268}, {-246, -245, -244}, {10, 11, 12}}));
  EXPECT_EQ(to_iso8601(page->calibrated), "2013-11-12T10:30:05Z");
  const CalibrationPage other{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                              from_unix_seconds(1'600'000'000)};
  ASSERT_OK(unit.write_calibration(other));
  EXPECT_EQ(*unit.read_calibration(), other);

  ASSERT_OK(unit.set_filter(FilterConfiguration::legacy));
  ASSERT_OK(unit.start_stream(100));
  for (std::uint32_t index = 0; index < 300; index += 6) {
    const auto block = unit.next_samples(seconds(1));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
    EXPECT_EQ((*block)->first_index, index);
    EXPECT_EQ((*block)->counts.at(5)[0], static_cast<std::int16_t>(index + 5));
    EXPECT_EQ((*block)->counts.at(5)[1], -static_cast<std::int16_t>(index + 5));
    EXPECT_EQ((*block)->filter, FilterConfiguration::legacy);
    EXPECT_DOUBLE_EQ((*block)->temperature_c, 24.5);
  }
  EXPECT_EQ(unit.stream_statistics().lost_samples, 0U);
  EXPECT_EQ(unit.stream_statistics().damaged_reports, 0U);
  EXPECT_EQ(unit.stream_statistics().clock_jumps, 0U);
  ASSERT_OK(unit.stop_stream());

  ASSERT_OK(unit.start_recording(30, from_unix_seconds(1'500'000'000)));
  ASSERT_OK(unit.stop_recording());
  const auto recordings = unit.recordings();
  ASSERT_OK(recordings);
  ASSERT_EQ(recordings->size(), 1U);
  EXPECT_EQ(recordings->front().start_unix_time, 1'500'000'000U);
  ASSERT_OK(unit.download(recordings->front(), posix_env().files, folder_ / "p.gt3x"));
  EXPECT_EQ(sha256(*read_file(posix_env().files, folder_ / "p.gt3x")), recordings->front().sha256);
}

// Both units, of one page, refuse the same with the same code.
TEST_F(UnitInPython, RefusesWhatTheVirtualUnitRefuses) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  mocks::VirtualUnit virtual_unit(options);
  std::uint16_t sequence = 100;
  const auto same = [&](int command, const Bytes& payload) {
    const auto wanted = static_cast<Command>(command);
    virtual_unit.take_report(
        encode({ReportKind::request, ++sequence, wanted, ReplyCode::ok, payload}), seconds(1));
    ReplyCode code{};
    while (const auto report = virtual_unit.next_report(seconds(1))) {
      const auto message = decode(*report);
      code = message->kind == ReportKind::reply ? message->code : code;
    }
    EXPECT_EQ(code_for(wanted, payload), code) << "command " << command << " with " << hex(payload);
  };
  // Every command with every length, nothing open.
  for (int command = 0; command <= 20; ++command) {
    for (std::size_t length = 0; length <= kPayloadBytes; ++length) {
      same(command, Bytes(length, 0));
    }
  }
  const Bytes begin = {0, 0, 2, 0x34, 0x12};
  for (const auto& [command, payload] :
       std::vector<std::pair<int, Bytes>>{{2, {1, 0, 0, 1}},
                                          {2, {0, 0xFF, 1, 1}},
                                          {2, {0, 0xFF, 1, 2}},
                                          {2, {0, 0, 0, 49}},
                                          {3, {1, 0, 2, 0, 0}},
                                          {3, {0, 1, 2, 0, 0}},
                                          {7, {}},
                                          {4, {0, 0, 1}},
                                          {3, begin},
                                          {4, {0xFF, 1, 1}},
                                          {4, {0xFF, 1, 1, 2}},
                                          {5, {0xFF, 1, 2}},
                                          {5, {0, 0, 0}},
                                          {6, {0x34, 0x12}},
                                          {6, {0, 0}},
                                          {7, {}},
                                          {6, {0x34, 0x12}},
                                          {9, {2}},
                                          {9, {1}},
                                          {10, {29, 0}},
                                          {10, {35, 0}},
                                          {10, {110, 0}},
                                          {10, {100, 0}},
                                          {9, {1}},
                                          {12, {30, 0, 0, 0, 0, 0}},
                                          {10, {30, 0}},
                                          {11, {}},
                                          {11, {}},
                                          {13, {}},
                                          {12, {31, 0, 0, 0, 0, 0}},
                                          {12, {30, 0, 0, 0, 0, 0}},
                                          {12, {30, 0, 0, 0, 0, 0}},
                                          {10, {30, 0}},
                                          {3, begin},
                                          {6, {0x34, 0x12}},
                                          {14, {0, 0}},
                                          {15, Bytes(14, 0)},
                                          {13, {}},
                                          {14, {0, 0}},
                                          {14, {1, 0}},
                                          {15, Bytes(14, 0)}}) {
    same(command, payload);
  }
}

}  // namespace
}  // namespace sixpoint::device
