// The motorised jig on USB. Oracle: docs/devices/motorised-jig.md, and HID 1.11 for the requests.
#include "mocks/usb/usb_jig.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/usb/usb_ids.h"
#include "device/wire/protocol.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

constexpr std::uint8_t kOut = 0x01;
constexpr std::uint8_t kIn = 0x81;

struct JigOnUsb {
  JigOnUsb() : jig({.serial = "J600042"}, nullptr, clock) {
    jig.bus_reset();
    EXPECT_EQ(jig.control({0x00, 9, 1, 0, 0}, {}).kind, Kind::done);
  }
  static device::Report request(int command, Bytes payload = {}, std::uint16_t sequence = 1) {
    return device::encode({device::ReportKind::request,
                           sequence,
                           static_cast<device::Command>(command),
                           {},
                           std::move(payload)});
  }
  Bytes reply() {
    const UsbAnswer answer = jig.in(kIn, 64);
    EXPECT_EQ(answer.kind, Kind::done);
    const auto message = device::decode(answer.bytes);
    EXPECT_OK(message);
    return message ? message->payload : Bytes{};
  }

  std::shared_ptr<ManualClock> clock = std::make_shared<ManualClock>();
  UsbJig jig;
};

TEST(UsbJig, IsOneHidInterface) {
  JigOnUsb on;
  EXPECT_EQ(on.jig.descriptors().vendor_id(), 0x1209);
  EXPECT_EQ(on.jig.descriptors().product_id(), device::kJigProductId);
  EXPECT_EQ(on.jig.descriptors().serial(), "J600042");
  const auto configuration = parse_configuration(on.jig.descriptors().configuration);
  ASSERT_OK(configuration);
  ASSERT_EQ(configuration->interfaces.size(), 1U);
  EXPECT_EQ(configuration->interfaces[0].device_class, 3) << "HID";
  ASSERT_EQ(configuration->endpoints.size(), 2U);
  for (const UsbEndpoint& endpoint : configuration->endpoints) {
    EXPECT_EQ(endpoint.type, UsbEndpoint::Type::interrupt);
    EXPECT_EQ(endpoint.max_packet, 64);
  }
}

// JIG_IDENTIFY: version, then the serial number in 16 bytes. By the endpoint, and by the request
// SET_REPORT (HID 1.11, 7.2.2), which a host may use in its place.
TEST(UsbJig, AnswersReportsOfEitherWay) {
  JigOnUsb on;
  EXPECT_EQ(on.jig.in(kIn, 64).kind, Kind::nothing_yet);
  EXPECT_EQ(on.jig.out(kOut, JigOnUsb::request(64, {}, 1)).kind, Kind::done);
  const Bytes identity = on.reply();
  ASSERT_GE(identity.size(), 41U);
  EXPECT_EQ(identity[0], 1);
  EXPECT_EQ(std::string(identity.begin() + 1, identity.begin() + 8), "J600042");
  EXPECT_EQ(identity[8], 0);
  EXPECT_EQ(on.jig.in(kIn, 64).kind, Kind::nothing_yet) << "one request, one reply";

  EXPECT_EQ(on.jig.control({0x21, 9, 0x0200, 0, 64}, JigOnUsb::request(64, {}, 2)).kind,
            Kind::done);
  EXPECT_EQ(on.reply(), identity);
  EXPECT_EQ(on.jig.control({0x21, 9, 0x0300, 0, 64}, JigOnUsb::request(64, {}, 3)).kind,
            Kind::stall)
      << "it has no feature report";
  EXPECT_EQ(on.jig.control({0x40, 9, 0x0200, 0, 64}, JigOnUsb::request(64, {}, 4)).kind,
            Kind::stall)
      << "nor vendor requests";
}

// JIG_GO_TO and JIG_STATE: turning (2), then standing (1) in the pose that was asked for (3, -y).
TEST(UsbJig, TurnsWhileTimePasses) {
  JigOnUsb on;
  EXPECT_EQ(on.jig.out(kOut, JigOnUsb::request(65, {3}, 1)).kind, Kind::done);
  EXPECT_EQ(on.reply(), Bytes{});
  const auto state = [&](std::uint16_t sequence) {
    EXPECT_EQ(on.jig.out(kOut, JigOnUsb::request(66, {}, sequence)).kind, Kind::done);
    const Bytes payload = on.reply();
    return payload.size() >= 2 ? std::pair<int, int>(payload[0], payload[1]) : std::pair(-1, -1);
  };
  EXPECT_EQ(state(2).first, 2);
  on.clock->sleep(std::chrono::seconds(10));
  EXPECT_EQ(state(3), (std::pair<int, int>(1, 3)));
}

TEST(UsbJig, AReplyThatDoesNotFitOverflowsAndWithoutACableIsGone) {
  JigOnUsb on;
  EXPECT_EQ(on.jig.out(kOut, JigOnUsb::request(64)).kind, Kind::done);
  EXPECT_EQ(on.jig.in(kIn, 63).kind, Kind::overflow);
  on.jig.unplug();
  EXPECT_EQ(on.jig.in(kIn, 64).kind, Kind::gone);
  EXPECT_EQ(on.jig.out(kOut, JigOnUsb::request(64)).kind, Kind::gone);
}

}  // namespace
}  // namespace sixpoint::mocks
