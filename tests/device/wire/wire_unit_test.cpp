#include "device/wire/wire_unit.h"

#include <functional>
#include <set>

#include <gmock/gmock.h>

#include "base/crc_ccitt.h"
#include "device/made_links.h"
#include "device/wire/made_bench.h"
#include "device/wire/payload.h"
#include "expect_result.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

using mocks::InertTransport;
using testing::HasSubstr;
using tests::Bench;
using tests::changed;

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

// Its files are known by the serial in capitals, and so are its runs and constants.
TEST(WireUnit, ASerialInSmallLettersIsTheOneOfItsFiles) {
  Bench bench;
  Link link = changed(
      bench.link(), [](Message&) {},
      [](Message& reply) {
        if (reply.command == Command::identify) {
          Identity small = *decode_identity(reply.payload);
          small.serial = "mos2a45130007";
          reply.payload = encode_identity(small);
        }
      });
  link.serial = "mos2a45130007";
  const auto unit = WireUnit::open(std::move(link));
  ASSERT_OK(unit);
  EXPECT_EQ((*unit)->identity().serial, "MOS2A45130007");
  EXPECT_EQ((*unit)->identify()->serial, "MOS2A45130007");
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

const CalibrationPage kNewPage{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                               from_unix_seconds(1'600'000'000)};

// One answer of the unit is another one than it gave: whole, with a right CRC.
TEST(WireUnit, AWrongAnswerIsRefusedByName) {
  const auto write = [](Unit& unit) { return unit.write_calibration(kNewPage); };
  const auto cut = [](Message& reply) { reply.payload.pop_back(); };
  const auto flip = [](Message& reply) { reply.payload[0] ^= 1; };
  struct Row {
    Command command;
    tests::Change change;
    std::function<Status(Unit&)> operation;
    ErrorCode code;
    const char* what;
  };
  const std::vector<Row> rows = {
      {Command::read_page, cut,
       [](Unit& unit) -> Status {
         SIXPOINT_CHECK(unit.read_calibration());
         return {};
       },
       ErrorCode::bad_data, "a part of the calibration page has the wrong length"},
      {Command::read_staged, flip, write, ErrorCode::io,
       "read back other constants than were sent"},
      {Command::read_staged, cut, write, ErrorCode::io, "read back other constants than were sent"},
      {Command::commit, flip, write, ErrorCode::io, "committed another page than was sent"},
      {Command::commit, cut, write, ErrorCode::io, "committed another page than was sent"},
      {Command::get_filter, flip,
       [](Unit& unit) { return unit.set_filter(FilterConfiguration::legacy); }, ErrorCode::io,
       "was told to use the filter 'legacy' and uses 'current'"},
      {Command::get_filter, cut,
       [](Unit& unit) { return unit.set_filter(FilterConfiguration::legacy); }, ErrorCode::bad_data,
       "the filter state is too short"},
      {Command::start_recording, cut,
       [](Unit& unit) -> Status {
         SIXPOINT_CHECK(unit.start_recording(100, from_unix_seconds(1'500'000'000)));
         return {};
       },
       ErrorCode::bad_data, "did not name its recording"},
      {Command::list_recording, cut,
       [](Unit& unit) -> Status {
         SIXPOINT_CHECK(unit.recordings());
         return {};
       },
       ErrorCode::bad_data, "the entry of a recording is too short"},
      {Command::identify, cut,
       [](Unit& unit) -> Status {
         SIXPOINT_CHECK(unit.identify());
         return {};
       },
       ErrorCode::bad_data, "the identity is too short"},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(std::string(to_string(row.command)) + ": " + row.what);
    Bench bench;
    bool lies = false;
    const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
      if (lies && reply.kind == ReportKind::reply && reply.command == row.command) {
        row.change(reply);
      }
    }));
    record(bench, *unit, 10);
    const CalibrationPage before = *unit->read_calibration();
    lies = true;
    const Status result = row.operation(*unit);
    lies = false;
    EXPECT_FAILS(result, row.code);
    EXPECT_THAT(result.error().what, HasSubstr(row.what));
    // Up to the commit the old constants are in force, and nothing of the new ones waits.
    const bool committed = row.command == Command::commit;
    EXPECT_EQ(*unit->read_calibration(), committed ? kNewPage : before);
    if (row.command == Command::read_staged) {
      bench.plugged->unit.take_report(
          encode({ReportKind::request, 0, Command::commit, ReplyCode::ok, Bytes(2)}),
          bench.clock->elapsed());
      EXPECT_EQ(decode(*bench.plugged->unit.next_report(bench.clock->elapsed()))->code,
                ReplyCode::no_transaction);
    }
  }
}

// The memory took another page than it announced: the page itself says so, not the answer.
TEST(WireUnit, APageThatIsNotTheOneThatWasWrittenIsAnError) {
  Bench bench;
  bool committed = false;
  const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
    committed = committed || reply.command == Command::commit;
    if (committed && reply.command == Command::read_page) {
      reply.payload[0] ^= 1;
    }
  }));
  const Status written = unit->write_calibration(kNewPage);
  EXPECT_FAILS(written, ErrorCode::io);
  EXPECT_THAT(written.error().what, HasSubstr("page is not the one that was written"));
}

// The constants of one unit must not reach another one that was plugged in meanwhile; nor do
// constants that no calibration gives reach any.
TEST(WireUnit, ConstantsGoToTheirUnitOrNowhere) {
  Bench bench;
  bool swapped = false;
  bool began = false;
  const auto unit = *WireUnit::open(changed(
      bench.link(), [&](Message& request) { began |= request.command == Command::begin_write; },
      [&](Message& reply) {
        if (swapped && reply.command == Command::identify) {
          Identity other = *decode_identity(reply.payload);
          other.serial = "MOS2A00000000";
          reply.payload = encode_identity(other);
        }
      }));
  CalibrationPage page = kNewPage;
  page.constants.positive_lsb[1] = page.constants.negative_lsb[1];
  EXPECT_FAILS(unit->write_calibration(page), ErrorCode::configuration);
  page = kNewPage;
  page.calibrated = from_unix_seconds(0);
  EXPECT_FAILS(unit->write_calibration(page), ErrorCode::configuration);
  swapped = true;
  const Status refused = unit->write_calibration(kNewPage);
  EXPECT_FAILS(refused, ErrorCode::device_unavailable);
  EXPECT_THAT(refused.error().what, HasSubstr("and is now MOS2A00000000"));
  EXPECT_FALSE(began);
  EXPECT_EQ(unit->identity().serial, bench.plugged->unit.truth().serial);
}

// Oracle: the codes of docs/protocol.md, and what a person can do about each.
TEST(WireUnit, EachRefusalHasItsNameAndItsHint) {
  struct Row {
    std::uint8_t code;
    const char* name;
    const char* hint;
  };
  const std::vector<Row> rows = {
      {1, "unknown command", "update the unit's firmware"},
      {2, "bad length", "update the unit's firmware"},
      {3, "bad argument", "update the unit's firmware"},
      {4, "busy", "stop the recording or the stream first"},
      {5, "no such recording", "list the unit's recordings again"},
      {6, "storage full", "download and clear the unit's recordings"},
      {7, "battery low", "charge the unit"},
      {8, "no transaction", "still holds its old constants"},
      {9, "CRC mismatch", "still holds its old constants"},
      {10, "storage fault", "the unit's memory is worn out"},
      {11, "unsupported version", "update the unit's firmware"},
      {200, "unknown code", "update the unit's firmware"},
  };
  for (const Row& row : rows) {
    Bench bench;
    const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
      if (reply.command == Command::get_filter) {
        reply.code = static_cast<ReplyCode>(row.code);
      }
    }));
    const auto refused = unit->filter();
    EXPECT_FAILS(refused, ErrorCode::io);
    EXPECT_EQ(refused.error().what, std::string("the unit refused 'get_filter': ") + row.name);
    EXPECT_THAT(refused.error().hint, HasSubstr(row.hint));
  }
}

TEST(WireUnit, AListThatChangesWhileItIsReadIsRefused) {
  Bench bench;
  bool lies = false;
  const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
    if (lies && reply.command == Command::list_recording) {
      ++reply.payload[0];  // each time one more than the unit has
      lies = false;
    }
  }));
  record(bench, *unit, 10);
  record(bench, *unit, 10);
  lies = true;
  const auto list = unit->recordings();
  EXPECT_FAILS(list, ErrorCode::bad_data);
  EXPECT_THAT(list.error().what, HasSubstr("changes while it is read"));
  EXPECT_EQ(unit->recordings()->size(), 2U);
}

// docs/protocol.md: 4096 recordings of 4 GiB at most. A unit that says more is asked no more.
TEST(WireUnit, AListWithoutEndAndARecordingWithoutEndAreRefused) {
  struct Row {
    std::size_t at;  // in the payload
    std::uint8_t value;
    const char* what;
  };
  for (const Row& row :
       {Row{1, 0xFF, "a list of 65281 recordings"}, Row{9, 0x01, "a recording of 1099511"}}) {
    Bench bench;
    int asked = 0;
    const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
      if (reply.command == Command::list_recording) {
        reply.payload[row.at] = row.value;
        ++asked;
      }
    }));
    ASSERT_OK(unit->start_recording(100, from_unix_seconds(1'500'000'000)));
    bench.clock->sleep(std::chrono::seconds(10));
    ASSERT_OK(unit->stop_recording());
    const auto list = unit->recordings();
    EXPECT_FAILS(list, ErrorCode::bad_data);
    EXPECT_THAT(list.error().what, HasSubstr(row.what));
    EXPECT_EQ(asked, 1);
  }
}

// docs/protocol.md: 0 at the first IDENTIFY, then 1, 2, 3 ... 65535, 1 ...
TEST(WireUnit, After65535RequestsTheSequenceIs1Again) {
  Bench bench;
  int last = -1;
  const auto unit = *WireUnit::open(
      changed(bench.link(), [&](Message& request) { last = request.sequence; }, {}));
  EXPECT_EQ(last, 0);
  for (int request = 1; request <= 65'535; ++request) {
    ASSERT_OK(unit->filter());
    ASSERT_EQ(last, request);
  }
  EXPECT_OK(unit->filter());
  EXPECT_EQ(last, 1);
}

// Samples that contradict themselves are counted and given to nobody.
TEST(WireUnit, SamplesThatCanNotBeAreDropped) {
  const std::vector<tests::Change> rows = {
      [](Message& report) { ++report.sequence; },       // one is missing, and no sample is
      [](Message& report) { report.payload[1] ^= 1; },  // 256 samples are missing, and no report is
      [](Message& report) { report.payload[14] = 9; },  // no such filter
      [](Message& report) { report.payload.pop_back(); },
  };
  for (std::size_t row = 0; row < rows.size(); ++row) {
    SCOPED_TRACE(row);
    Bench bench;
    int left = 3;  // the third report of samples is changed
    const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& report) {
      if (report.kind == ReportKind::samples && --left == 0) {
        rows[row](report);
      }
    }));
    ASSERT_OK(unit->start_stream(100));
    std::vector<std::uint32_t> indices;
    while (indices.size() < 4) {
      const auto block = unit->next_samples(std::chrono::seconds(1));
      ASSERT_OK(block);
      ASSERT_TRUE(*block);
      indices.push_back((*block)->first_index);
    }
    EXPECT_THAT(indices, testing::ElementsAre(0U, 6U, 18U, 24U));
    EXPECT_EQ(unit->stream_statistics().damaged_reports, 1U);
    EXPECT_EQ(unit->stream_statistics().lost_samples, 6U);
  }
}

// Samples that were under way when the stream stopped belong to no stream.
TEST(WireUnit, SamplesWithoutAStreamAreDropped) {
  Bench bench;
  bool first = true;
  const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& reply) {
    if (reply.command == Command::get_filter && std::exchange(first, false)) {
      SampleBlock block;
      block.counts.resize(6);
      reply = encode_samples(block);
    }
  }));
  EXPECT_OK(unit->filter());
  EXPECT_FALSE(first);
  EXPECT_EQ(unit->stream_statistics().samples, 0U);
  EXPECT_EQ(unit->stream_statistics().damaged_reports, 0U);
}

// A program that does not read for a while: what it gets is counted, and so is what it missed.
TEST(WireUnit, BlocksThatNobodyReadsAreCountedAsLost) {
  Bench bench;
  WireOptions options;
  options.waiting_blocks = 3;
  bool first = true;  // the first answer gets lost: all that comes before the second is read
  const auto unit = *WireUnit::open(
      changed(bench.link(), {},
              [&](Message& reply) {
                if (reply.command == Command::get_filter && std::exchange(first, false)) {
                  ++reply.sequence;
                }
              }),
      options);
  ASSERT_OK(unit->start_stream(100));
  bench.clock->sleep(std::chrono::seconds(1));
  ASSERT_OK(unit->filter());
  const std::uint64_t overflowed = unit->stream_statistics().overflowed_blocks;
  EXPECT_GT(overflowed, 5U);
  std::uint64_t taken = 0;
  std::uint32_t end = 0;
  for (int i = 0; i < 5; ++i) {
    const auto block = unit->next_samples(std::chrono::seconds(1));
    ASSERT_OK(block);
    ASSERT_TRUE(*block);
    taken += (*block)->counts.size();
    end = (*block)->first_index + 6;
  }
  EXPECT_EQ(unit->stream_statistics().lost_samples, end - taken);
  EXPECT_GE(end - taken, overflowed * 6);
}

// Oracle: the jump that is put in. The unit's clock jumps; its samples go on without a gap.
TEST(WireUnit, AJumpOfTheUnitsClockIsCounted) {
  Bench bench;
  int reports = 0;
  const auto unit = *WireUnit::open(changed(bench.link(), {}, [&](Message& report) {
    if (report.kind == ReportKind::samples && ++reports > 3) {
      SampleBlock block = *decode_samples(report);
      block.device_time_us += 10'000'000;
      report = encode_samples(block);
    }
  }));
  ASSERT_OK(unit->start_stream(100));
  for (int i = 0; i < 10; ++i) {
    ASSERT_OK(unit->next_samples(std::chrono::seconds(1)));
  }
  EXPECT_EQ(unit->stream_statistics().clock_jumps, 1U);
  EXPECT_NEAR(unit->stream_statistics().clock_jumped_s, 10, 0.001);
  EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
}

// The table of unit.h, reconnect(). The link of the bench is opened again while the unit is away.
TEST(WireUnit, ReconnectingWaitsForTheSameUnit) {
  Bench bench;
  int attempts = 0;
  int back_at = 5;  // the attempt at which it is plugged in again
  const auto open_again = [&]() -> Result<Link> {
    if (++attempts < back_at) {
      return fail(ErrorCode::device_unavailable, "no such device", {}, "another one is there");
    }
    bench.plugged->unplugged = false;
    return bench.link();
  };
  Link link = bench.link();
  link.reopen = open_again;
  const auto unit = *WireUnit::open(std::move(link));
  EXPECT_OK(unit->reconnect(std::chrono::seconds(10))) << "it was not away";
  EXPECT_EQ(attempts, 0);
  const auto unplug = [&] {
    bench.plugged->unplugged = true;
    attempts = 0;
  };
  unplug();
  int looks = 0;
  EXPECT_OK(unit->reconnect(std::chrono::seconds(10), [&]() -> Status {
    ++looks;
    return {};
  }));
  EXPECT_EQ(attempts, 5);
  EXPECT_EQ(looks, 5);
  EXPECT_OK(unit->filter());
  unplug();
  back_at = 1'000'000;
  const auto began = bench.clock->elapsed();
  const Status away = unit->reconnect(std::chrono::seconds(10));
  EXPECT_FAILS(away, ErrorCode::device_unavailable);
  EXPECT_THAT(away.error().what, HasSubstr("did not come back within 10 s"));
  EXPECT_EQ(away.error().hint, "another one is there");
  EXPECT_GE(bench.clock->elapsed() - began, std::chrono::seconds(10));
  unplug();
  const Status stopped = unit->reconnect(std::chrono::seconds(10), [&]() -> Status {
    return attempts < 2 ? Status{} : fail(ErrorCode::internal, "stopped", {}, "begin anew");
  });
  EXPECT_FAILS(stopped, ErrorCode::internal);
  EXPECT_EQ(attempts, 2);
  unplug();
  const Status cancelled = unit->reconnect(std::chrono::hours(1), [&]() -> Status {
    unit->cancel();
    return {};
  });
  EXPECT_FAILS(cancelled, ErrorCode::device_unavailable);
  EXPECT_EQ(attempts, 1) << "after cancel() nothing is opened any more";
}

TEST(WireUnit, AnotherUnitThatComesBackIsRefusedAtOnce) {
  Bench bench;
  Bench other;
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(8);
  options.truth.serial = "MOS2B99990001";
  other.plugged = std::make_shared<mocks::PluggedUnit>(options, other.clock);
  Link link = bench.link();
  int attempts = 0;
  link.reopen = [&]() -> Result<Link> {
    ++attempts;
    return other.link();
  };
  const auto unit = *WireUnit::open(std::move(link));
  const std::string serial = unit->identity().serial;
  bench.plugged->unplugged = true;
  const Status swapped = unit->reconnect(std::chrono::hours(1));
  EXPECT_FAILS(swapped, ErrorCode::device_unavailable);
  EXPECT_EQ(swapped.error().what, "the unit was " + serial + " and is now MOS2B99990001");
  EXPECT_EQ(attempts, 1);
  EXPECT_EQ(unit->identity().serial, serial);
}

// A link that cannot be opened again: the error of the first attempt is the answer.
TEST(WireUnit, WithoutAWayToOpenItAgainReconnectingEndsAtOnce) {
  Bench bench;
  Link link = bench.link();
  link.reopen = {};
  const auto unit = *WireUnit::open(std::move(link));
  bench.plugged->unplugged = true;
  const auto began = bench.clock->elapsed();
  EXPECT_FAILS(unit->reconnect(std::chrono::hours(1)), ErrorCode::device_unavailable);
  EXPECT_LT(bench.clock->elapsed() - began, std::chrono::hours(1));
}

// A device on reports alone.
TEST(WireUnit, CancelReachesEveryChannelThatIsThere) {
  Bench bench;
  for (const bool with_bulk : {false, true}) {
    Link link = bench.link();
    auto bulk = std::make_unique<InertTransport>(bench.clock);
    const InertTransport* const counted = bulk.get();
    link.bulk.reset();
    if (with_bulk) {
      link.bulk = std::move(bulk);
    }
    const auto unit = *WireUnit::open(std::move(link));
    unit->cancel();
    EXPECT_FAILS(unit->filter(), ErrorCode::device_unavailable);
    EXPECT_EQ(counted->cancels, with_bulk ? 1 : 0);
    bench.plugged->cancelled = false;
  }
}

}  // namespace
}  // namespace sixpoint::device
