#include "mocks/usb/usbip_session.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/protocol.h"
#include "expect_result.h"
#include "mocks/usb/usb_unit.h"
#include "usbip_client.h"
#include "usbip_messages.h"

namespace sixpoint::mocks {
namespace {

using tests::request_report;
using tests::submit_header;
using tests::UsbipClient;
using Data = UsbipClient::Data;

// A session fed one byte at a time behaves as one fed at once.
TEST(UsbipSession, TakesItsBytesInAnyPieces) {
  const auto answer = [](std::size_t piece) {
    const auto clock = std::make_shared<ManualClock>();
    VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    UsbipBus bus({std::make_shared<UsbUnit>(std::make_shared<PluggedUnit>(options, clock))});
    UsbipSession session(bus);
    Data bytes = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
    bytes.resize(40, 0);
    Data submit = submit_header(1, 0, 1, 64, 0);
    const Data report = request_report(device::Command::identify, 1);
    submit.insert(submit.end(), report.begin(), report.end());
    bytes.insert(bytes.end(), submit.begin(), submit.end());
    const Data in = submit_header(1, 1, 1, 64, 0);
    bytes.insert(bytes.end(), in.begin(), in.end());
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      session.receive(std::span(bytes).subspan(at, std::min(piece, bytes.size() - at)));
    }
    EXPECT_FALSE(session.is_over());
    return Data(session.output().begin(), session.output().end());
  };
  const Data whole = answer(100000);
  EXPECT_EQ(whole.size(), 8U + 312U + 48U + 48U + 64U);
  for (const std::size_t piece : {1U, 7U, 48U, 63U}) {
    EXPECT_EQ(answer(piece), whole) << piece;
  }
}

TEST(UsbipSession, MakesAPeerWaitThatDoesNotFetchItsAnswers) {
  const auto clock = std::make_shared<ManualClock>();
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  UsbipBus bus({std::make_shared<UsbUnit>(std::make_shared<PluggedUnit>(options, clock))});
  UsbipLimits limits;
  limits.waiting_bytes = 1000;
  UsbipSession session(bus, limits);
  Data import = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
  import.resize(40, 0);
  session.receive(import);
  EXPECT_TRUE(session.wants_input());
  Data control = submit_header(1, 1, 0, 18, 0);
  const Data setup = {0x80, 6, 0, 1, 0, 0, 18, 0};
  std::copy(setup.begin(), setup.end(), control.begin() + 40);
  for (int i = 0; i < 100; ++i) {
    session.receive(control);
  }
  EXPECT_FALSE(session.wants_input());
  EXPECT_LT(session.output().size(), 1100U);
  std::size_t fetched = 0;
  while (!session.output().empty()) {
    fetched += session.output().size();
    session.sent(session.output().size());
    session.pump();
  }
  EXPECT_EQ(fetched, 8U + 312U + 100U * (48U + 18U)) << "nothing was lost";
  EXPECT_TRUE(session.wants_input());
}

// A plan swaps the unit: the session ends as by the cable, and after the plan's second another unit
// is at the same bus id, with descriptors of its own.
TEST(UsbipSession, AFaultPlanSwapsTheUnit) {
  const auto clock = std::make_shared<ManualClock>();
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  auto plan = parse_fault_plan(R"({"schema": "sixpoint/faults/1", "faults": [
      {"fault": "swap", "at_report": 2, "seconds": 1, "serial": "MOS2B99990009"}]})");
  ASSERT_OK(plan);
  const auto unit = std::make_shared<UsbUnit>(std::make_shared<PluggedUnit>(options, *plan, clock));
  UsbipBus bus({unit});
  Data import = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
  import.resize(40, 0);
  const Data in = submit_header(1, 1, 1, 64, 0);
  {
    UsbipSession session(bus);
    session.receive(import);
    for (std::uint16_t i = 1; i <= 2; ++i) {
      Data out = submit_header(1, 0, 1, 64, 0);
      const Data report = request_report(device::Command::get_filter, i);
      out.insert(out.end(), report.begin(), report.end());
      session.receive(out);
      session.receive(in);
      EXPECT_EQ(session.is_over(), i == 2) << i;
    }
    const auto output = session.output();
    const Data status(output.end() - 28, output.end() - 24);
    EXPECT_EQ(UsbipClient::get(status, 0, 4), 0xFFFFFFFFU - 107) << "ESHUTDOWN";
  }
  const auto import_status = [&] {
    UsbipSession session(bus);
    session.receive(import);
    return session.output()[7];
  };
  EXPECT_EQ(import_status(), 4) << "nothing is there yet";
  clock->sleep(std::chrono::seconds(2));
  EXPECT_EQ(import_status(), 0);
  EXPECT_EQ(unit->descriptors().serial(), "MOS2B99990009");
}

}  // namespace
}  // namespace sixpoint::mocks
