#include "mocks/in_process/in_process.h"

#include <array>
#include <set>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/protocol.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Cable {
  Cable() {
    VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    plugged = std::make_shared<PluggedUnit>(std::move(options), clock);
    link = link_to(plugged, false);
  }
  Status ask() {
    return link.reports->write(
        device::encode({device::ReportKind::request, 1, device::Command::identify, {}, {}}),
        seconds(1));
  }
  Result<std::size_t> read(std::size_t room = device::kReportBytes) {
    buffer.assign(room, 0);
    return link.reports->read(buffer, milliseconds(100));
  }

  std::shared_ptr<ManualClock> clock = std::make_shared<ManualClock>();
  std::shared_ptr<PluggedUnit> plugged;
  device::Link link;
  Bytes buffer;
};

// device/transport.h: 0 where nothing came in time, and the time is the link's.
TEST(InProcess, WaitsForAReportOnItsOwnClock) {
  Cable cable;
  const auto before = cable.clock->elapsed();
  EXPECT_EQ(*cable.read(), 0U);
  EXPECT_EQ(cable.clock->elapsed() - before, milliseconds(100));
  ASSERT_OK(cable.ask());
  EXPECT_EQ(*cable.read(), 64U);
  const auto reply = device::decode(cable.buffer);
  ASSERT_OK(reply);
  EXPECT_EQ(device::decode_identity(reply->payload)->serial, cable.plugged->unit.truth().serial);
  EXPECT_EQ(*cable.read(), 0U) << "one request, one reply";
}

TEST(InProcess, AReportThatDoesNotFitIsAnError) {
  Cable cable;
  ASSERT_OK(cable.ask());
  EXPECT_FAILS(cable.read(63), ErrorCode::bad_data);
}

TEST(InProcess, WithoutTheCableEverythingIsUnavailable) {
  Cable cable;
  cable.plugged->unplugged = true;
  EXPECT_FAILS(cable.ask(), ErrorCode::device_unavailable);
  EXPECT_FAILS(cable.read(), ErrorCode::device_unavailable);
  EXPECT_FAILS(cable.link.bulk->read(cable.buffer, milliseconds(1)), ErrorCode::device_unavailable);
  EXPECT_FAILS(cable.link.reopen(), ErrorCode::device_unavailable);
  cable.plugged->unplugged = false;
  auto again = cable.link.reopen();
  ASSERT_OK(again);
  cable.link = *std::move(again);
  ASSERT_OK(cable.ask());
  EXPECT_EQ(*cable.read(), 64U);
}

TEST(InProcess, ACancelledReadEnds) {
  Cable cable;
  cable.link.reports->cancel();
  EXPECT_FAILS(cable.read(), ErrorCode::device_unavailable);
}

// docs/faults.md, `unplug`: at the plan's time the unit is gone, and back after its seconds; a
// channel of before stays dead, because the unit was enumerated anew.
TEST(InProcess, AFaultPlanPullsTheCableAndPutsItBack) {
  Cable cable;
  auto plan = parse_fault_plan(R"({"schema": "sixpoint/faults/1",
      "faults": [{"fault": "unplug", "at_s": 5, "seconds": 3}]})");
  ASSERT_OK(plan);
  cable.plugged->faults = FaultInjector(*plan, cable.clock->elapsed());
  ASSERT_OK(cable.ask());
  EXPECT_EQ(*cable.read(), 64U);
  cable.clock->sleep(seconds(6));
  EXPECT_FAILS(cable.read(), ErrorCode::device_unavailable);
  EXPECT_FAILS(cable.link.reopen(), ErrorCode::device_unavailable);
  cable.clock->sleep(seconds(3));
  auto again = cable.link.reopen();
  ASSERT_OK(again);
  EXPECT_FAILS(cable.read(), ErrorCode::device_unavailable);  // the channel of before
  EXPECT_OK(device::WireUnit::open(std::move(*again)));
}

// The scheme `virtual:` (docs/virtual.md): a seed is a unit, `jig=auto` brings a jig, waiting takes
// no time of the machine.
TEST(InProcess, TheSchemeOpensTheUnitOfItsSettings) {
  MemoryEnv memory;
  device::TransportRegistry links;
  register_virtual(links);
  std::set<std::string> serials;
  for (const char* address : {"virtual:seed=7", "virtual:seed=7", "virtual:seed=8"}) {
    auto link = links.open(address, memory.env);
    ASSERT_OK(link);
    EXPECT_EQ(link->jig, nullptr);
    const auto machine = memory.clock.elapsed();
    Bytes buffer(device::kReportBytes);
    EXPECT_EQ(*link->reports->read(buffer, seconds(10)), 0U);
    EXPECT_EQ(memory.clock.elapsed(), machine) << "the link has a clock of its own";
    const auto unit = device::WireUnit::open(std::move(*link));
    ASSERT_OK(unit);
    serials.insert((*unit)->identity().serial);
  }
  EXPECT_EQ(serials.size(), 2U);
  auto with_jig = links.open("virtual:seed=7,jig=auto,pace=real", memory.env);
  ASSERT_OK(with_jig);
  EXPECT_NE(with_jig->jig, nullptr);
  const auto machine = memory.clock.elapsed();
  with_jig->clock->sleep(seconds(2));
  EXPECT_EQ(memory.clock.elapsed() - machine, seconds(2)) << "pace=real is the machine's clock";

  EXPECT_FAILS(links.open("virtual:colour=red", memory.env), ErrorCode::usage);
  EXPECT_FAILS(links.open("virtual:interfaces=storage", memory.env), ErrorCode::usage);
  EXPECT_FAILS(links.open("virtual:faults=none.json", memory.env), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::mocks
