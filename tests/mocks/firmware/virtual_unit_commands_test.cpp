// What a unit answers to each command, as raw reports. Oracle: the tables of docs/protocol.md;
// every payload here is written down from them.
#include <functional>
#include <numeric>
#include <optional>

#include <gtest/gtest.h>

#include "device/wire/protocol.h"
#include "mocks/firmware/virtual_unit.h"
#include "sim/recording.h"

namespace sixpoint::mocks {
namespace {

enum Number : std::uint8_t {
  kIdentify = 1,
  kReadPage,
  kBeginWrite,
  kWriteStaged,
  kReadStaged,
  kCommit,
  kAbortWrite,
  kGetFilter,
  kSetFilter,
  kStartStream,
  kStopStream,
  kStartRecording,
  kStopRecording,
  kListRecording,
  kDownload,
  kGetTime,
};

struct Reply {
  int code = -1;  // none came
  Bytes payload;
  bool operator==(const Reply&) const = default;
};

// CRC-CCITT bit by bit, from its definition: 0x1021, start 0xFFFF, not reflected.
std::uint16_t crc_of(std::span<const std::uint8_t> bytes) {
  unsigned crc = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    crc ^= static_cast<unsigned>(byte) << 8U;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc & 0x8000U) != 0 ? (crc << 1U) ^ 0x1021U : crc << 1U;
      crc &= 0xFFFFU;
    }
  }
  return static_cast<std::uint16_t>(crc);
}

std::uint8_t low(std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); }
std::uint8_t high(std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); }

Bytes report_of(std::uint8_t version, std::uint16_t sequence, std::uint8_t command,
                const Bytes& payload) {
  Bytes report = {version,
                  1,
                  low(sequence),
                  high(sequence),
                  command,
                  0,
                  static_cast<std::uint8_t>(payload.size()),
                  0};
  report.insert(report.end(), payload.begin(), payload.end());
  report.resize(62, 0);
  const std::uint16_t crc = crc_of(report);
  report.push_back(low(crc));
  report.push_back(high(crc));
  return report;
}

// A unit, and requests whose sequence is counted as a station counts it.
struct Asked {
  static VirtualUnitOptions of_known_identity() {
    sim::GivenProperties given;
    given.serial = "MOS2A45130007";
    given.firmware = "1.5.0";
    given.accel_scale_lsb_per_g = 341;
    VirtualUnitOptions options;
    options.truth = sim::draw_unit(7, given);
    return options;
  }
  Reply ask(std::uint8_t command, const Bytes& payload = {}) {
    return send(report_of(1, ++sequence, command, payload));
  }
  Reply send(const Bytes& report) {
    unit.take_report(report, now);
    const auto answer = unit.next_report(now);
    if (!answer) {
      return {};
    }
    EXPECT_EQ((*answer)[1], 2) << "a reply";
    EXPECT_EQ((*answer)[2], report[2]) << "the request's sequence";
    EXPECT_EQ((*answer)[3], report[3]);
    EXPECT_EQ((*answer)[4], report[4]) << "the request's command";
    return {(*answer)[5], Bytes(answer->begin() + 8, answer->begin() + 8 + (*answer)[6])};
  }

  VirtualUnit unit{of_known_identity()};
  std::uint16_t sequence = 0;
  nanoseconds now{0};
};

const Bytes k100Hz = {100, 0};
// 100 Hz from 2014-05-13 16:53:20 UTC, which is 1'400'000'000 s.
const Bytes kRecord = {100, 0, 0x00, 0x4E, 0x72, 0x53};

TEST(VirtualUnitCommands, TheCheckOfThisFileIsThePagesOwn) {
  const Bytes digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(crc_of(digits), 0x29B1);
}

TEST(VirtualUnitCommands, IdentifyHasTheFieldsOfThePage) {
  Asked asked;
  // Version 1, monitor, 4100 mV, 341 LSB/g, pages of 512 bytes.
  Bytes expected = {1, 0, 0x04, 0x10, 0x55, 0x01, 0x00, 0x02};
  const auto put = [&](std::string_view text, std::size_t bytes) {
    expected.insert(expected.end(), text.begin(), text.end());
    expected.insert(expected.end(), bytes - text.size(), 0);
  };
  put("MOS2A45130007", 16);
  put("1.5.0", 12);
  put("wGT3XBT", 12);
  EXPECT_EQ(asked.ask(kIdentify), (Reply{0, expected}));
}

// Real units of the family call themselves "Link" in info.txt.
TEST(VirtualUnitCommands, ALinkIsCalledTheSameOnTheWireAndInInfo) {
  sim::GivenProperties given;
  given.serial = "TAS1H30182785";
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7, given);
  VirtualUnit unit(options);
  unit.take_report(report_of(1, 1, kIdentify, {}), nanoseconds(0));
  const auto answer = unit.next_report(nanoseconds(0));
  ASSERT_TRUE(answer);
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(answer->data()) + 8 + 36), "Link");
  EXPECT_EQ(sim::recording_info(options.truth, {}, {}, 30, 4000).device_type(), "Link");
}

// The table of codes: what each command is refused with.
TEST(VirtualUnitCommands, RefusesAsTheTableSays) {
  Bytes too_long = {0, 0};
  too_long.resize(2 + 49);
  const struct {
    const char* what;
    std::vector<std::pair<std::uint8_t, Bytes>> before;
    std::uint8_t command;
    Bytes payload;
    int code;
  } kRows[] = {
      {"no such command", {}, 99, {}, 1},
      {"no command at all", {}, 0, {}, 1},
      {"a payload too many", {}, kIdentify, {0}, 2},
      {"a payload too few", {}, kSetFilter, {}, 2},
      {"another page", {}, kReadPage, {1, 0, 0, 16}, 3},
      {"no bytes", {}, kReadPage, {0, 0, 0, 0}, 3},
      {"49 bytes", {}, kReadPage, {0, 0, 0, 49}, 3},
      {"beyond the page's end", {}, kReadPage, {0, 0xF4, 0x01, 13}, 3},
      {"up to the page's end", {}, kReadPage, {0, 0xF4, 0x01, 12}, 0},
      {"write another page", {}, kBeginWrite, {1, 0x00, 0x02, 0, 0}, 3},
      {"write another length", {}, kBeginWrite, {0, 0xFF, 0x01, 0, 0}, 3},
      {"nothing is staged", {}, kWriteStaged, {0, 0, 1}, 8},
      {"nothing is staged", {}, kReadStaged, {0, 0, 1}, 8},
      {"nothing is staged", {}, kCommit, {0, 0}, 8},
      {"no bytes to stage", {{kBeginWrite, {0, 0, 2, 0, 0}}}, kWriteStaged, {0, 0}, 2},
      {"49 bytes to stage", {{kBeginWrite, {0, 0, 2, 0, 0}}}, kWriteStaged, too_long, 2},
      {"staged beyond the end",
       {{kBeginWrite, {0, 0, 2, 0, 0}}},
       kWriteStaged,
       {0xFF, 0x01, 1, 2},
       3},
      {"read beyond the end", {{kBeginWrite, {0, 0, 2, 0, 0}}}, kReadStaged, {0xFF, 0x01, 2}, 3},
      {"another check", {{kBeginWrite, {0, 0, 2, 0, 0}}}, kCommit, {1, 0}, 9},
      {"staged bytes of another check", {{kBeginWrite, {0, 0, 2, 0, 0}}}, kCommit, {0, 0}, 9},
      {"while it records",
       {{kBeginWrite, {0, 0, 2, 0, 0}}, {kStartRecording, kRecord}},
       kCommit,
       {0, 0},
       4},
      {"no such filter", {}, kSetFilter, {2}, 3},
      {"while it streams", {{kStartStream, k100Hz}}, kSetFilter, {1}, 4},
      {"no such rate", {}, kStartStream, {35, 0}, 3},
      {"too fast", {}, kStartStream, {110, 0}, 3},
      {"while it records", {{kStartRecording, kRecord}}, kStartStream, k100Hz, 4},
      {"begins anew", {{kStartStream, k100Hz}}, kStartStream, k100Hz, 0},
      {"while it streams", {{kStartStream, k100Hz}}, kStartRecording, kRecord, 4},
      {"while it records", {{kStartRecording, kRecord}}, kStartRecording, kRecord, 4},
      {"no such rate", {}, kStartRecording, {20, 0, 0, 0, 0, 0}, 3},
      {"none runs", {}, kStopRecording, {}, 5},
      {"the second of none", {}, kListRecording, {1, 0}, 5},
      {"none to download", {}, kDownload, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0}, 5},
      {"while it records",
       {{kStartRecording, kRecord}},
       kDownload,
       {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0},
       4},
      {"an offset behind the end",
       {{kStartRecording, kRecord}, {kStopRecording, {}}},
       kDownload,
       {1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0},
       3},
  };
  for (const auto& row : kRows) {
    SCOPED_TRACE(std::string(row.what) + ", command " + std::to_string(row.command));
    Asked asked;
    for (const auto& [command, payload] : row.before) {
      ASSERT_EQ(asked.ask(command, payload).code, 0);
    }
    const Reply reply = asked.ask(row.command, row.payload);
    EXPECT_EQ(reply.code, row.code);
    EXPECT_TRUE(row.code == 0 || reply.payload.empty()) << "a refusal has no payload";
  }
}

TEST(VirtualUnitCommands, BelowThreeThousandThreeHundredMillivoltsNothingIsRecordedOrWritten) {
  for (const std::uint16_t battery_mv : {std::uint16_t{3299}, std::uint16_t{3300}}) {
    const int code = battery_mv < 3300 ? 7 : 0;
    Asked asked;
    asked.unit.set_battery_mv(battery_mv);
    const Bytes empty(512, 0xFF);
    const std::uint16_t crc = crc_of(empty);
    ASSERT_EQ(asked.ask(kBeginWrite, {0, 0x00, 0x02, low(crc), high(crc)}).code, 0);
    EXPECT_EQ(asked.ask(kCommit, {low(crc), high(crc)}).code, code) << battery_mv;
    EXPECT_EQ(asked.ask(kStartRecording, kRecord).code, code) << battery_mv;
  }
}

TEST(VirtualUnitCommands, AFullFlashRecordsNothing) {
  Asked asked;
  asked.unit.fill_flash(asked.now);
  EXPECT_EQ(asked.ask(kStartRecording, kRecord).code, 6);
}

TEST(VirtualUnitCommands, WhatIsNotThereIsNoErrorWhereThePageSaysSo) {
  Asked asked;
  EXPECT_EQ(asked.ask(kListRecording, {0, 0}), (Reply{0, {0, 0}})) << "a count of 0 alone";
  EXPECT_EQ(asked.ask(kStopStream), (Reply{0, {0, 0, 0, 0}})) << "0 samples";
  EXPECT_EQ(asked.ask(kAbortWrite).code, 0);
}

// "Writing a page is a transaction", step by step.
TEST(VirtualUnitCommands, APageIsStagedReadBackAndCommitted) {
  Asked asked;
  Bytes page(512);
  std::iota(page.begin(), page.end(), std::uint8_t{1});
  const std::uint16_t crc = crc_of(page);
  ASSERT_EQ(asked.ask(kBeginWrite, {0, 0x00, 0x02, low(crc), high(crc)}).code, 0);
  EXPECT_EQ(asked.ask(kReadStaged, {0, 0, 3}), (Reply{0, {0xFF, 0xFF, 0xFF}})) << "empty";
  // In any order: here from the end to the beginning.
  for (int offset = 480; offset >= 0; offset -= 32) {
    Bytes chunk = {low(static_cast<std::uint16_t>(offset)),
                   high(static_cast<std::uint16_t>(offset))};
    chunk.insert(chunk.end(), page.begin() + offset, page.begin() + offset + 32);
    ASSERT_EQ(asked.ask(kWriteStaged, chunk).code, 0) << offset;
  }
  EXPECT_EQ(asked.ask(kReadStaged, {0xFE, 0x01, 2}), (Reply{0, {page[510], page[511]}}));
  const Reply before = asked.ask(kReadPage, {0, 0, 0, 4});
  EXPECT_NE(before.payload, Bytes(page.begin(), page.begin() + 4)) << "not yet in force";
  EXPECT_EQ(asked.ask(kCommit, {low(crc), high(crc)}), (Reply{0, {low(crc), high(crc)}}));
  for (int offset = 0; offset < 512; offset += 32) {
    EXPECT_EQ(asked.ask(kReadPage, {0, low(static_cast<std::uint16_t>(offset)),
                                    high(static_cast<std::uint16_t>(offset)), 32}),
              (Reply{0, Bytes(page.begin() + offset, page.begin() + offset + 32)}))
        << offset;
  }
  EXPECT_EQ(asked.ask(kCommit, {low(crc), high(crc)}).code, 8) << "the transaction is over";
}

TEST(VirtualUnitCommands, AnAbortedWriteIsOver) {
  Asked asked;
  ASSERT_EQ(asked.ask(kBeginWrite, {0, 0x00, 0x02, 0, 0}).code, 0);
  ASSERT_EQ(asked.ask(kAbortWrite).code, 0);
  EXPECT_EQ(asked.ask(kReadStaged, {0, 0, 1}).code, 8);
}

// "SET_FILTER sets it until power-off"; 1.5.0 records a unit of before 2014-03-24 under `current`.
TEST(VirtualUnitCommands, TheFilterOfTheStreamIsSetAndThatOfRecordingsIsNot) {
  Asked asked;
  EXPECT_EQ(asked.ask(kGetFilter), (Reply{0, {1, 1}}));
  ASSERT_EQ(asked.ask(kSetFilter, {0}).code, 0);
  EXPECT_EQ(asked.ask(kGetFilter), (Reply{0, {0, 1}}));
}

// The sequence rule: "a request with the same sequence, command and payload as the one before is
// not executed again", and sequence 0 always is.
TEST(VirtualUnitCommands, ARepeatedRequestIsAnsweredAgainAndNotDoneAgain) {
  Asked asked;
  const Bytes record = report_of(1, 5, kStartRecording, kRecord);
  EXPECT_EQ(asked.send(record), (Reply{0, {1, 0}}));
  EXPECT_EQ(asked.send(record), (Reply{0, {1, 0}})) << "the kept reply";
  EXPECT_EQ(asked.send(report_of(1, 6, kStartRecording, kRecord)).code, 4) << "a new request";
  EXPECT_EQ(asked.send(report_of(1, 6, kStartRecording, kRecord)).code, 4) << "a kept refusal";
  EXPECT_EQ(asked.send(report_of(1, 7, kStopRecording, {})), (Reply{0, {1, 0}}));
  const Bytes always = report_of(1, 0, kStartRecording, kRecord);
  EXPECT_EQ(asked.send(always), (Reply{0, {2, 0}}));
  EXPECT_EQ(asked.send(always).code, 4);
}

// "A whole report of a version that a unit does not speak is answered with code 11", and what is
// no whole report is dropped without an answer.
TEST(VirtualUnitCommands, OtherVersionsAreAnsweredAndNoiseIsNot) {
  Asked asked;
  EXPECT_EQ(asked.send(report_of(2, 0x0107, kIdentify, {})), (Reply{11, {}}));
  Bytes noise = report_of(1, 8, kIdentify, {});
  noise[20] ^= 1;  // the check does not fit
  EXPECT_EQ(asked.send(noise).code, -1);
  noise = report_of(2, 8, kIdentify, {});
  noise[63] ^= 1;
  EXPECT_EQ(asked.send(noise).code, -1);
  Bytes brief = report_of(1, 9, kIdentify, {});
  brief.resize(63);
  EXPECT_EQ(asked.send(brief).code, -1);
}

// "START_RECORDING: the unit sets its clock by it". Oracle: 12 s later it is 12 s later.
TEST(VirtualUnitCommands, TheClockIsSetByTheRecording) {
  Asked asked;
  asked.now = std::chrono::seconds(100);
  ASSERT_EQ(asked.ask(kStartRecording, {100, 0, 0x10, 0, 0, 0x60}).code, 0);
  asked.now += std::chrono::seconds(12);
  const Reply time = asked.ask(kGetTime);
  ASSERT_EQ(time.payload.size(), 12U);
  EXPECT_EQ(Bytes(time.payload.begin() + 8, time.payload.end()), (Bytes{0x1C, 0, 0, 0x60}));
  ASSERT_EQ(asked.ask(kStopRecording), (Reply{0, {1, 0}}));
  const Reply list = asked.ask(kListRecording, {0, 0});
  ASSERT_EQ(list.payload.size(), 48U);
  EXPECT_EQ(Bytes(list.payload.begin(), list.payload.begin() + 4), (Bytes{1, 0, 1, 0}));
  EXPECT_EQ(Bytes(list.payload.begin() + 12, list.payload.begin() + 16), (Bytes{0x10, 0, 0, 0x60}));
  // A length beyond the end is cut there: what will come is what LIST_RECORDING says there is.
  const Reply download =
      asked.ask(kDownload, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF});
  EXPECT_EQ(download.payload, Bytes(list.payload.begin() + 4, list.payload.begin() + 12));
}

// "GET_TIME: u64 device_time_us, u32 unix_time", from the first byte of lowest weight.
std::pair<std::uint64_t, std::uint32_t> time_of(Asked& asked) {
  const Reply time = asked.ask(kGetTime);
  EXPECT_EQ(time.payload.size(), 12U);
  std::uint64_t device_time_us = 0;
  std::uint32_t unix_time_s = 0;
  for (std::size_t i = 0; i < time.payload.size(); ++i) {
    const std::uint64_t byte = time.payload[i];
    device_time_us |= i < 8 ? byte << 8 * i : 0;
    unix_time_s |= i < 8 ? 0 : static_cast<std::uint32_t>(byte << 8 * (i - 8));
  }
  return {device_time_us, unix_time_s};
}

// Device time is unsigned. Back by an hour after 40 s it is 0, and runs on from there; the calendar
// goes back by the whole hour.
TEST(VirtualUnitCommands, AClockThatJumpsBackBelowZeroRunsOnFromZero) {
  Asked asked;
  asked.now = std::chrono::seconds(40);
  const std::uint32_t before_s = time_of(asked).second;
  asked.unit.jump_clock(-std::chrono::hours(1), asked.now);
  EXPECT_EQ(time_of(asked), std::pair(std::uint64_t{0}, before_s - 3600));
  asked.now += std::chrono::milliseconds(2500);
  EXPECT_EQ(time_of(asked), std::pair(std::uint64_t{2'500'000}, before_s - 3598));
  asked.unit.jump_clock(std::chrono::seconds(10), asked.now);
  EXPECT_EQ(time_of(asked).first, 12'500'000U) << "forth as far as it says";
  asked.unit.jump_clock(-std::chrono::seconds(4), asked.now);
  EXPECT_EQ(time_of(asked).first, 8'500'000U) << "back as far as it says";
}

// A host that asks and never reads takes no memory without end; what it asked last is there.
TEST(VirtualUnitCommands, AHostThatNeverReadsGetsTheNewestReplies) {
  Asked asked;
  for (std::uint16_t sequence = 1; sequence <= 1000; ++sequence) {
    asked.unit.take_report(report_of(1, sequence, kIdentify, {}), asked.now);
    asked.unit.take_report(report_of(1, sequence, kIdentify, {}), asked.now);  // the kept reply
    asked.unit.take_report(report_of(2, sequence, kIdentify, {}), asked.now);  // another version
  }
  std::size_t replies = 0;
  std::optional<device::Report> last;
  for (auto reply = asked.unit.next_report(asked.now); reply;
       reply = asked.unit.next_report(asked.now)) {
    ++replies;
    last = reply;
  }
  EXPECT_EQ(replies, 64U);
  EXPECT_EQ(last.value()[2], low(1000));
  EXPECT_EQ(last.value()[3], high(1000));
}

// docs/protocol.md: a unit holds at most 4096 recordings.
TEST(VirtualUnitCommands, NoRecordingBeginsWhereThereAre4096) {
  Asked asked;
  for (int i = 0; i < 4096; ++i) {
    ASSERT_TRUE(asked.unit.keep_recording({1}, {}));
  }
  EXPECT_EQ(asked.ask(kStartRecording, kRecord).code, 6);
}

}  // namespace
}  // namespace sixpoint::mocks
