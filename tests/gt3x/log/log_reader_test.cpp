#include "gt3x/log/log_reader.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "expect_result.h"
#include "gt3x_made_log.h"

namespace sixpoint::gt3x {
namespace {

using tests::append_second;
using tests::kStart;
using tests::made_log;

// What a reader made of some bytes, with the promise checked that the items are the input.
struct Reading {
  struct Seen {
    std::uint8_t type;
    std::uint32_t time;
    bool checksum_ok;
  };
  std::vector<Seen> records;
  LogStatistics statistics;

  std::size_t good(RecordType type) const {
    return static_cast<std::size_t>(std::count_if(records.begin(), records.end(), [&](auto& r) {
      return r.checksum_ok && r.type == static_cast<std::uint8_t>(type);
    }));
  }
};

Reading read(const Bytes& log, std::unique_ptr<ByteSource> source = nullptr) {
  LogReader reader(source ? std::move(source) : std::make_unique<MemorySource>(log));
  Reading reading;
  Bytes joined;
  for (;;) {
    const auto item = reader.next();
    EXPECT_TRUE(item.has_value());
    if (!item || !*item) {
      break;
    }
    EXPECT_EQ((*item)->offset, joined.size());
    EXPECT_FALSE((*item)->raw.empty());
    joined.insert(joined.end(), (*item)->raw.begin(), (*item)->raw.end());
    if ((*item)->kind == LogItem::Kind::record) {
      const Record& record = (*item)->record;
      reading.records.push_back({record.type, record.unix_time, record.checksum_ok});
    }
  }
  EXPECT_EQ(joined, log) << "the items, one behind the other, must be the input";
  reading.statistics = reader.statistics();
  EXPECT_EQ(reading.statistics.bytes, log.size());
  return reading;
}

TEST(LogReader, ReadsWhatWasWritten) {
  const auto reading = read(made_log(10));
  EXPECT_EQ(reading.good(RecordType::activity), 10U);
  EXPECT_EQ(reading.good(RecordType::lux), 10U);
  EXPECT_EQ(reading.good(RecordType::parameters), 1U);
  EXPECT_EQ(reading.statistics.count(RecordType::activity), 10U);
  EXPECT_EQ(reading.statistics.checksum_failures, 0U);
  EXPECT_EQ(reading.statistics.damaged_bytes, 0U);
  EXPECT_TRUE(read({}).records.empty());
}

// One byte at a time, as a slow source may give them.
class SlowSource final : public ByteSource {
 public:
  explicit SlowSource(const Bytes& bytes) : bytes_(bytes) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (at_ == bytes_.size()) {
      return 0;
    }
    out[0] = bytes_[at_++];
    return 1;
  }

 private:
  const Bytes& bytes_;
  std::size_t at_ = 0;
};

TEST(LogReader, DoesNotCareHowTheBytesCome) {
  const Bytes log = made_log(5);
  EXPECT_EQ(read(log, std::make_unique<SlowSource>(log)).good(RecordType::activity), 5U);
}

TEST(LogReader, ZerosBetweenRecordsAreLegal) {
  Bytes log = made_log(2);
  log.insert(log.end(), 3, 0);
  append_second(log, 2);
  log.insert(log.end(), 100'000, 0);
  append_second(log, 3);
  log.insert(log.end(), 3, 0);
  const auto reading = read(log);
  EXPECT_EQ(reading.good(RecordType::activity), 4U);
  EXPECT_EQ(reading.statistics.stray_bytes, 100'006U);
  EXPECT_EQ(reading.statistics.damaged_stretches, 0U);
}

TEST(LogReader, AWrongChecksumIsCountedAndOnlyThat) {
  Bytes log;
  for (std::uint32_t second = 0; second < 20; ++second) {
    append_second(log, second);
    if (second == 7 || second == 8 || second == 19) {
      log.back() ^= 0x40;  // two in a row, and the last of all
    }
  }
  const auto reading = read(log);
  EXPECT_EQ(reading.good(RecordType::activity), 17U);
  EXPECT_EQ(reading.records.size(), 20U);
  EXPECT_EQ(reading.statistics.checksum_failures, 3U);
  ASSERT_EQ(reading.statistics.failures.size(), 3U);
  EXPECT_EQ(reading.statistics.failures[0].unix_time, kStart + 7);
  EXPECT_EQ(reading.statistics.damaged_stretches, 0U);
}

TEST(LogReader, EveryChecksumWrongIsStillFramed) {
  Bytes log;
  for (std::uint32_t second = 0; second < 30; ++second) {
    append_second(log, second);
    log.back() ^= 0x01;
  }
  const auto reading = read(log);
  EXPECT_EQ(reading.records.size(), 30U);
  EXPECT_EQ(reading.statistics.checksum_failures, 30U);
}

// Every single byte of one record in turn, turned to every kind of wrong: never more than that
// record is lost, and what is lost lies between its neighbours' times.
TEST(LogReader, OneDamagedByteLosesOneRecordAtMost) {
  Bytes clean;
  std::size_t from = 0;
  std::size_t to = 0;
  for (std::uint32_t second = 0; second < 12; ++second) {
    from = second == 5 ? clean.size() : from;
    append_second(clean, second);
    to = second == 5 ? clean.size() : to;
  }
  for (std::size_t at = from; at < to; ++at) {
    for (const unsigned flip : {0x01U, 0x80U, 0xFFU, 0x1EU, 0x10U}) {
      Bytes log = clean;
      log[at] = static_cast<std::uint8_t>(log[at] ^ flip);
      const auto reading = read(log);
      ASSERT_EQ(reading.good(RecordType::activity), 11U) << "byte " << at << " flip " << flip;
      const auto& statistics = reading.statistics;
      ASSERT_EQ(statistics.checksum_failures + statistics.damaged_stretches, 1U)
          << "byte " << at << " flip " << flip;
      if (!statistics.losses.empty()) {
        EXPECT_EQ(statistics.losses[0].time_before, kStart + 4);
        EXPECT_EQ(statistics.losses[0].time_after, kStart + 6);
      }
    }
  }
}

TEST(LogReader, GarbageBetweenRecordsLosesNoRecord) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    Bytes log = made_log(6);
    const std::size_t garbage = 1 + random.below(3000);
    for (std::size_t i = 0; i < garbage; ++i) {
      // Separators and record-like bytes more often than chance.
      log.push_back(random.below(4) == 0 ? kSeparator : static_cast<std::uint8_t>(random.bits()));
    }
    if (log[log.size() - garbage] == 0) {
      log[log.size() - garbage] = 1;
    }
    for (std::uint32_t second = 6; second < 12; ++second) {
      append_second(log, second);
    }
    const auto reading = read(log);
    EXPECT_EQ(reading.good(RecordType::activity), 12U) << round;
    EXPECT_GE(reading.statistics.damaged_stretches, 1U);
    ASSERT_FALSE(reading.statistics.losses.empty());
    EXPECT_EQ(reading.statistics.losses.front().time_before, kStart + 5);
  }
}

TEST(LogReader, ALongStretchOfGarbageIsOneLoss) {
  Random random(4);
  Bytes log = made_log(3);
  for (int i = 0; i < 5'000'000; ++i) {
    log.push_back(static_cast<std::uint8_t>(random.bits() | 1U));
  }
  append_second(log, 3);
  append_second(log, 4);
  const auto reading = read(log);
  EXPECT_EQ(reading.good(RecordType::activity), 5U);
  EXPECT_EQ(reading.statistics.damaged_stretches, 1U);
  ASSERT_EQ(reading.statistics.losses.size(), 1U);
  EXPECT_EQ(reading.statistics.losses[0].bytes, 5'000'000U);
  EXPECT_EQ(reading.statistics.losses[0].time_after, kStart + 3);
}

TEST(LogReader, TruncatedAtEveryByteKeepsWhatIsWhole) {
  const Bytes log = made_log(4);
  std::vector<std::size_t> ends;  // where each record ends
  for (std::size_t at = 0; at < log.size();) {
    at += kRecordOverhead + log[at + 6] + static_cast<std::size_t>(log[at + 7]) * 256;
    ends.push_back(at);
  }
  for (std::size_t size = 0; size <= log.size(); ++size) {
    const auto reading = read(Bytes(log.begin(), log.begin() + static_cast<std::ptrdiff_t>(size)));
    const auto whole = static_cast<std::size_t>(
        std::count_if(ends.begin(), ends.end(), [&](std::size_t end) { return end <= size; }));
    EXPECT_EQ(reading.records.size(), whole) << size;
    const std::size_t last_end = whole == 0 ? 0 : ends[whole - 1];
    EXPECT_EQ(reading.statistics.damaged_bytes, size - last_end);
  }
}

TEST(LogReader, FindsItsWayAcrossALeapOfTime) {
  Bytes log = made_log(3);
  log.insert(log.end(), 20, 0x55);
  append_second(log, 90 * 86'400);  // a shelf: far from what came before, near what comes behind
  append_second(log, 90 * 86'400 + 1);
  const auto reading = read(log);
  EXPECT_EQ(reading.good(RecordType::activity), 5U);
}

// Nothing but separators: each claims a record of 7,719 bytes, whose checksum fails. The time limit
// of the test program is what a quadratic search would run into.
TEST(LogReader, HostileInputStaysLinear) {
  const Bytes log(3'000'000, kSeparator);
  const auto reading = read(log);
  EXPECT_EQ(reading.good(static_cast<RecordType>(kSeparator)), 0U);
  EXPECT_EQ(reading.statistics.checksum_failures, reading.records.size());
}

}  // namespace
}  // namespace sixpoint::gt3x
