#include "mocks/faults/fault_injector.h"

#include <gtest/gtest.h>

#include "device/wire/payload.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using CableKind = CableEvent::Kind;
using std::chrono::milliseconds;
using std::chrono::seconds;

// A unit behind a plan; the test is the carrier.
struct FaultyBench {
  explicit FaultyBench(const std::string& faults)
      : injector(
            *parse_fault_plan(R"({"schema": "sixpoint/faults/1", "faults": [)" + faults + "]}"),
            nanoseconds(0)) {}
  CableEvent write(device::Command command, Bytes payload = {}) {
    const auto report = device::encode({device::ReportKind::request, ++sequence, command,
                                        device::ReplyCode::ok, std::move(payload)});
    return injector.write_report(unit, report, now);
  }
  CableEvent read() { return injector.read_report(unit, now); }
  CableEvent exchange() {
    EXPECT_EQ(write(device::Command::identify).kind, CableKind::data);
    return read();
  }
  bool answers() {
    const CableEvent event = exchange();
    return event.kind == CableKind::data && device::decode(event.bytes).has_value();
  }

  VirtualUnit unit{{.truth = sim::draw_unit(7)}};
  FaultInjector injector;
  nanoseconds now{0};
  std::uint16_t sequence = 0;
};

TEST(FaultInjector, WithoutFaultsEverythingPasses) {
  FaultyBench bench("");
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(bench.answers());
  }
  EXPECT_EQ(bench.read().kind, CableKind::nothing);
  EXPECT_TRUE(bench.injector.plugged());
  EXPECT_EQ(bench.injector.enumeration(), 0U);
}

// `at_report` counts from 1; `every` and `count` as docs/faults.md describes them.
TEST(FaultInjector, CountAndEveryChooseTheReports) {
  FaultyBench bench(R"({"fault": "lost", "at_report": 3, "count": 2, "every": 5})");
  std::string passed;
  for (int i = 0; i < 14; ++i) {
    passed += bench.answers() ? '+' : '-';
  }
  EXPECT_EQ(passed, "++--+++--+++--");
}

TEST(FaultInjector, TransfersAreChangedAsTheKindDescribes) {
  FaultyBench flip(R"({"fault": "bit_flip", "at_report": 1, "byte": 10, "bit": 4})");
  FaultyBench clean("");
  Bytes changed = flip.exchange().bytes;
  const Bytes whole = clean.exchange().bytes;
  ASSERT_EQ(changed.size(), whole.size());
  changed[10] ^= 0x10;
  EXPECT_EQ(changed, whole);

  FaultyBench part(R"({"fault": "short_packet", "at_report": 1, "bytes": 7})");
  EXPECT_EQ(part.exchange().bytes, Bytes(whole.begin(), whole.begin() + 7));

  FaultyBench twice(R"({"fault": "duplicate", "at_report": 1})");
  EXPECT_EQ(twice.exchange().bytes, whole);
  EXPECT_EQ(twice.read().bytes, whole);
  EXPECT_EQ(twice.read().kind, CableKind::nothing);

  FaultyBench crc(R"({"fault": "bad_crc", "at_report": 1})");
  EXPECT_FAILS(device::decode(crc.exchange().bytes), ErrorCode::bad_data);

  FaultyBench sequence(R"({"fault": "wrong_sequence", "at_report": 1})");
  const auto message = device::decode(sequence.exchange().bytes);
  ASSERT_OK(message);
  EXPECT_NE(message->sequence, 1);
}

TEST(FaultInjector, AStallKeepsTheDataAndADelayHoldsThem) {
  FaultyBench stall(R"({"fault": "stall", "at_report": 1})");
  EXPECT_EQ(stall.exchange().kind, CableKind::stalled);
  EXPECT_EQ(stall.read().kind, CableKind::data);

  FaultyBench delay(R"({"fault": "delay", "at_report": 1, "seconds": 0.5})");
  EXPECT_EQ(delay.exchange().kind, CableKind::nothing);
  EXPECT_EQ(delay.injector.next_due(delay.unit), nanoseconds(milliseconds(500)));
  delay.now = milliseconds(499);
  EXPECT_EQ(delay.read().kind, CableKind::nothing);
  delay.now = milliseconds(500);
  EXPECT_EQ(delay.read().kind, CableKind::data);
}

TEST(FaultInjector, AnUnpluggedUnitComesBackAsAnotherEnumeration) {
  FaultyBench bench(R"({"fault": "unplug", "at_s": 20, "seconds": 2})");
  EXPECT_TRUE(bench.answers());
  EXPECT_EQ(bench.injector.next_due(bench.unit), nanoseconds(seconds(20)));
  bench.now = seconds(21);
  EXPECT_EQ(bench.read().kind, CableKind::gone);
  EXPECT_FALSE(bench.injector.plugged());
  bench.now = seconds(22);
  EXPECT_TRUE(bench.answers());
  EXPECT_EQ(bench.injector.enumeration(), 1U);
}

TEST(FaultInjector, ASwapBringsAnotherSerial) {
  FaultyBench bench(R"({"fault": "swap", "at_s": 1, "serial": "MOS2B99990007"})");
  bench.now = seconds(2);
  bench.injector.advance(bench.unit, bench.now);
  const auto message = device::decode(bench.exchange().bytes);
  ASSERT_OK(message);
  EXPECT_EQ(device::decode_identity(message->payload)->serial, "MOS2B99990007");
  EXPECT_EQ(bench.injector.enumeration(), 1U);
}

TEST(FaultInjector, BatteryAndFlashFaultsAreSeenInTheReplies) {
  FaultyBench bench(R"({"fault": "battery_low", "at_s": 1, "battery_mv": 3100},
                 {"fault": "battery_low", "at_s": 3, "battery_mv": 4000},
                 {"fault": "full_flash", "at_s": 3})");
  const auto start = [&] {
    bench.write(device::Command::start_recording,
                device::payload_of(std::uint16_t{30}, std::uint32_t{1'000'000}));
    return device::decode(bench.read().bytes)->code;
  };
  bench.now = seconds(2);
  EXPECT_EQ(start(), device::ReplyCode::battery_low);
  bench.now = seconds(4);
  EXPECT_EQ(start(), device::ReplyCode::storage_full);
}

}  // namespace
}  // namespace sixpoint::mocks
