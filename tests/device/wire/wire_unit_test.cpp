#include "device/wire/wire_unit.h"

#include <set>

#include <gtest/gtest.h>

#include "base/crc_ccitt.h"
#include "device/wire/made_bench.h"
#include "device/wire/payload.h"
#include "expect_result.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

using mocks::InertTransport;
using tests::Bench;

TEST(WireUnit, IdentifiesAndReadsItsConstants) {
  Bench bench;
  auto unit = WireUnit::open(bench.link());
  ASSERT_OK(unit);
  const auto& truth = bench.plugged->unit.truth();
  EXPECT_EQ((*unit)->identity().serial, truth.serial);
  EXPECT_EQ((*unit)->identity().firmware, "1.5.0");
  const auto page = (*unit)->read_calibration();
  ASSERT_OK(page);
  EXPECT_EQ(page->constants, truth.constants);
  EXPECT_EQ(page->calibrated, truth.calibrated);
  const auto filter = (*unit)->filter();
  ASSERT_OK(filter);
  EXPECT_EQ(filter->recording, FilterConfiguration::current) << "1.5.0 lacks the check";
  ASSERT_OK((*unit)->set_filter(FilterConfiguration::legacy));
  EXPECT_EQ((*unit)->filter()->stream, FilterConfiguration::legacy);
  EXPECT_EQ((*unit)->filter()->recording, FilterConfiguration::current);
}

TEST(WireUnit, WritesConstantsAndReadsThemBack) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const CalibrationPage page{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                             from_unix_seconds(1'600'000'000)};
  ASSERT_OK(unit->write_calibration(page));
  EXPECT_EQ(*unit->read_calibration(), page);
  // Constants of a later date: the firmware keeps `current` from now on.
  bench.plugged->unit.cut_power(bench.clock->elapsed());
  bench.plugged->unit.restore_power(bench.clock->elapsed());
  EXPECT_EQ(*unit->read_calibration(), page);
}

// Every request or reply lost once, in turn: the same result, and nothing executed twice.
TEST(WireUnit, LostRequestsAndRepliesAreRepeated) {
  for (const bool lose_request : {true, false}) {
    for (std::size_t victim = 0; victim < 40; ++victim) {
      Bench bench;
      std::size_t count = 0;
      const auto lose = [&](Bytes&) { return count++ == victim ? 0 : 1; };
      const auto pass = [](Bytes&) { return 1; };
      Link link = lose_request ? bench.tampered(lose, pass) : bench.tampered(pass, lose);
      auto unit = WireUnit::open(std::move(link));
      ASSERT_OK(unit);
      const CalibrationPage page{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                                 from_unix_seconds(1'600'000'000)};
      ASSERT_OK((*unit)->write_calibration(page));
      EXPECT_EQ(*(*unit)->read_calibration(), page);
      EXPECT_EQ(bench.plugged->unit.memory().bytes_written(), kPageBytes + 8)
          << "one commit, written once";
    }
  }
}

// Every byte of every reply flipped, one at a time: the request is repeated and the answer right.
TEST(WireUnit, EveryFlippedByteOfAReplyIsSurvived) {
  for (std::size_t at = 0; at < kReportBytes; ++at) {
    Bench bench;
    bool done = false;
    auto unit = WireUnit::open(bench.tampered([](Bytes&) { return 1; },
                                              [&](Bytes& bytes) {
                                                if (!done) {
                                                  bytes[at] ^= 0x40;
                                                  done = true;
                                                }
                                                return 1;
                                              }));
    ASSERT_OK(unit);
    EXPECT_EQ((*unit)->identity().serial, bench.plugged->unit.truth().serial);
    EXPECT_EQ((*unit)->stream_statistics().damaged_reports, 1U);
  }
}

TEST(WireUnit, ASilentUnitIsUnavailableAfterItsTimeOuts) {
  const auto clock = std::make_shared<ManualClock>();
  Link link;
  auto transport = std::make_unique<InertTransport>(clock);
  InertTransport* inert = transport.get();
  link.reports = std::move(transport);
  link.clock = clock;
  link.address = "hid:X";
  const auto began = clock->elapsed();
  EXPECT_FAILS(WireUnit::open(std::move(link)), ErrorCode::device_unavailable);
  EXPECT_EQ(clock->elapsed() - began, 4 * WireOptions{}.reply_time_out);
  (void)inert;
}

// A hostile unit that sends whole reports with right checksums for ever must not stop the station.
TEST(WireUnit, ChatterDoesNotHang) {
  const auto clock = std::make_shared<ManualClock>();
  class Chatter final : public Transport {
   public:
    explicit Chatter(std::shared_ptr<ManualClock> clock) : clock_(std::move(clock)) {}
    Status write(std::span<const std::uint8_t>, std::chrono::nanoseconds) override { return {}; }
    Result<std::size_t> read(std::span<std::uint8_t> out, std::chrono::nanoseconds) override {
      clock_->sleep(std::chrono::milliseconds(1));
      const Report report =
          encode({ReportKind::reply, 999, Command::identify, ReplyCode::ok, Bytes(10)});
      std::copy(report.begin(), report.end(), out.begin());
      return report.size();
    }
    void cancel() override {}

   private:
    std::shared_ptr<ManualClock> clock_;
  };
  Link link;
  link.reports = std::make_unique<Chatter>(clock);
  link.clock = clock;
  EXPECT_FAILS(WireUnit::open(std::move(link)), ErrorCode::device_unavailable);
}

TEST(WireUnit, UnknownCommandsAndWrongLengthsAreRefusedByCode) {
  Bench bench;
  const auto ask = [&](Command command, Bytes payload) {
    bench.plugged->unit.take_report(
        encode({ReportKind::request, 0, command, ReplyCode::ok, std::move(payload)}),
        bench.clock->elapsed());
    return decode(*bench.plugged->unit.next_report(bench.clock->elapsed()))->code;
  };
  EXPECT_EQ(ask(static_cast<Command>(77), {}), ReplyCode::unknown_command);
  for (const Command command :
       {Command::identify, Command::get_filter, Command::get_time, Command::abort_write}) {
    EXPECT_EQ(ask(command, {1}), ReplyCode::bad_length);
  }
  for (const Command command :
       {Command::read_page, Command::begin_write, Command::read_staged, Command::commit,
        Command::set_filter, Command::start_stream, Command::start_recording,
        Command::list_recording, Command::download, Command::write_staged}) {
    EXPECT_EQ(ask(command, {}), ReplyCode::bad_length);
  }
  EXPECT_EQ(ask(Command::set_filter, {2}), ReplyCode::bad_argument);
  EXPECT_EQ(ask(Command::start_stream, {7, 0}), ReplyCode::bad_argument);
  EXPECT_EQ(ask(Command::commit, {0, 0}), ReplyCode::no_transaction);
  EXPECT_EQ(ask(Command::write_staged, {0, 0, 1}), ReplyCode::no_transaction);
  EXPECT_EQ(ask(Command::read_page, {0, 255, 1, 2}), ReplyCode::bad_argument);
  EXPECT_EQ(ask(Command::begin_write, {0, 0, 2, 0x34, 0x12}), ReplyCode::ok);
  EXPECT_EQ(ask(Command::write_staged, {254, 1, 1, 2, 3}), ReplyCode::bad_argument);
  EXPECT_EQ(ask(Command::commit, {0x34, 0x12}), ReplyCode::crc_mismatch);

  Report other = encode({});
  other[0] = 2;
  const std::uint16_t crc = crc_ccitt(std::span(other).first(62));
  other[62] = static_cast<std::uint8_t>(crc & 0xFF);
  other[63] = static_cast<std::uint8_t>(crc >> 8);
  bench.plugged->unit.take_report(other, bench.clock->elapsed());
  EXPECT_EQ(decode(*bench.plugged->unit.next_report(bench.clock->elapsed()))->code,
            ReplyCode::unsupported_version);
}

TEST(WireUnit, StreamsRawCountsInOrderWithTimeAndTemperature) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  ASSERT_OK(unit->set_filter(FilterConfiguration::current));
  ASSERT_OK(unit->start_stream(100));
  std::uint32_t expected = 0;
  std::uint64_t first_time_us = 0;
  PerAxis<double> sum{};
  while (expected < 3000) {
    const auto block = unit->next_samples(std::chrono::seconds(1));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
    EXPECT_EQ((*block)->first_index, expected);
    EXPECT_EQ((*block)->filter, FilterConfiguration::current);
    EXPECT_NEAR((*block)->temperature_c, 24.5, 0.005);
    if (expected == 0) {
      first_time_us = (*block)->device_time_us;
    }
    EXPECT_NEAR(static_cast<double>((*block)->device_time_us - first_time_us), expected * 1e4, 2);
    for (const RawCounts& counts : (*block)->counts) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        sum[axis] += counts[axis];
      }
    }
    expected += static_cast<std::uint32_t>((*block)->counts.size());
  }
  // Oracle: closed form, z up under `current`; 0.2 LSB = 3 standard errors and the seating.
  const auto& sensor = bench.plugged->unit.truth().current;
  EXPECT_NEAR(sum[0] / expected, sensor.zero_lsb[0], 0.2);
  EXPECT_NEAR(sum[2] / expected, sensor.zero_lsb[2] + sensor.sensitivity_lsb_per_g[2], 0.2);
  EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
  ASSERT_OK(unit->stop_stream());
  const auto none = unit->next_samples(std::chrono::seconds(1));
  ASSERT_OK(none);
  EXPECT_FALSE(none->has_value());
}

TEST(WireUnit, LostAndDuplicatedReportsAreSeen) {
  Bench bench;
  int samples_reports = 0;
  auto unit = *WireUnit::open(
      bench.tampered([](Bytes&) { return 1; },
                     [&](Bytes& bytes) {
                       if (bytes[1] != 3) {
                         return 1;
                       }
                       ++samples_reports;
                       return samples_reports == 5 ? 0 : samples_reports == 9 ? 2 : 1;
                     }));
  ASSERT_OK(unit->start_stream(100));
  std::set<std::uint32_t> seen;
  for (int i = 0; i < 30; ++i) {
    const auto block = unit->next_samples(std::chrono::seconds(1));
    ASSERT_OK(block);
    if (*block) {
      EXPECT_TRUE(seen.insert((*block)->first_index).second) << "delivered once";
    }
  }
  EXPECT_EQ(unit->stream_statistics().lost_samples, kSamplesPerReport);
  EXPECT_EQ(unit->stream_statistics().duplicate_reports, 1U);
}

TEST(WireUnit, UnpluggingIsSeenAtOnce) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  ASSERT_OK(unit->start_stream(100));
  ASSERT_OK(unit->next_samples(std::chrono::seconds(1)));
  bench.plugged->unplugged = true;
  EXPECT_FAILS(unit->next_samples(std::chrono::seconds(1)), ErrorCode::device_unavailable);
  EXPECT_FAILS(unit->stop_stream(), ErrorCode::device_unavailable);
}

TEST(WireUnit, RefusalsSayWhatToDo) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  bench.plugged->unit.set_battery_mv(3200);
  EXPECT_FAILS(unit->start_recording(100, from_unix_seconds(0)), ErrorCode::io);
  const CalibrationPage page{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                             from_unix_seconds(1'600'000'000)};
  const auto before = *unit->read_calibration();
  EXPECT_FAILS(unit->write_calibration(page), ErrorCode::io);
  EXPECT_EQ(*unit->read_calibration(), before);
  bench.plugged->unit.set_battery_mv(4000);
  ASSERT_OK(unit->start_recording(100, from_unix_seconds(0)));
  EXPECT_FAILS(unit->start_stream(100), ErrorCode::io);
  EXPECT_FAILS(unit->write_calibration(page), ErrorCode::io);
}

}  // namespace
}  // namespace sixpoint::device
