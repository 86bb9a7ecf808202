#include "mocks/usb/usb_unit.h"

#include <gtest/gtest.h>

#include "device/unit.h"
#include "device/usb/usb_ids.h"
#include "device/wire/payload.h"
#include "expect_result.h"
#include "gt3x/forms/info.h"
#include "mocks/in_process/virtual_jig.h"
#include "usb_host.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

// Expected bytes are those of USB 2.0, table 9-8, HID 1.11 and docs/protocol.md, written out.
TEST(UsbUnit, DescriptorsAreTheDocumentedOnes) {
  UsbHost host;
  EXPECT_EQ(
      host.ask(0x80, 6, 0x0100, 0, 18).bytes,
      (Bytes{18, 1, 0x00, 0x02, 0, 0, 0, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1}));
  EXPECT_EQ(host.ask(0x80, 6, 0x0100, 0, 8).bytes.size(), 8U);
  EXPECT_EQ(host.ask(0x80, 6, 0x0100, 0, 255).bytes.size(), 18U);
  EXPECT_EQ(host.ask(0x80, 6, 0x0100, 0, 0).bytes.size(), 0U);
  const Bytes expected = {9, 2,    87,   0, 3,    1,    0, 0xC0, 50,  //
                          9, 4,    0,    0, 2,    3,    0, 0,    4,  9,    0x21, 0x11, 0x01, 0,
                          1, 0x22, 25,   0,                                                      //
                          7, 5,    0x81, 3, 64,   0,    4, 7,    5,  0x01, 3,    64,   0,    4,  //
                          9, 4,    1,    0, 2,    0xFF, 0, 0,    5,  7,    5,    0x82, 2,    0,
                          2, 0,    7,    5, 0x02, 2,    0, 2,    0,  //
                          9, 4,    2,    0, 2,    8,    6, 0x50, 6,  7,    5,    0x83, 2,    0,
                          2, 0,    7,    5, 0x03, 2,    0, 2,    0};
  Bytes configuration = host.ask(0x80, 6, 0x0200, 0, 9).bytes;
  EXPECT_EQ(configuration, Bytes(expected.begin(), expected.begin() + 9));
  configuration = host.ask(0x80, 6, 0x0200, 0, 0xFFFF).bytes;
  EXPECT_EQ(configuration, expected);
  const Bytes hid = host.ask(0x81, 6, 0x2200, 0, 0xFFFF).bytes;
  EXPECT_EQ(hid,
            (Bytes{0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75,
                   0x08, 0x95, 0x40, 0x09, 0x01, 0x81, 0x02, 0x09, 0x01, 0x91, 0x02, 0xC0}));
  EXPECT_EQ(configuration[25] | (configuration[26] << 8), static_cast<int>(hid.size()));
  EXPECT_EQ(host.ask(0x81, 6, 0x2100, 0, 9).bytes,
            Bytes(expected.begin() + 18, expected.begin() + 27));
  EXPECT_EQ(host.ask(0x81, 6, 0x2200, 1, 64).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x80, 6, 0x0F00, 0, 64).kind, Kind::stall) << "USB 2.0 has no BOS";
  EXPECT_EQ(host.ask(0x80, 6, 0x0201, 0, 64).kind, Kind::stall) << "there is one configuration";
}

TEST(UsbUnit, StringsWithLanguageTableAndSerial) {
  UsbHost host;
  EXPECT_EQ(host.ask(0x80, 6, 0x0300, 0, 255).bytes, (Bytes{4, 3, 0x09, 0x04}));
  const std::string serial = host.plugged->unit.truth().serial;
  const Bytes text = host.ask(0x80, 6, 0x0303, 0x0409, 255).bytes;
  ASSERT_EQ(text.size(), 2 + 2 * serial.size());
  EXPECT_EQ(text[0], text.size());
  EXPECT_EQ(text[1], 3);
  for (std::size_t i = 0; i < serial.size(); ++i) {
    EXPECT_EQ(text[2 + 2 * i], serial[i]);
    EXPECT_EQ(text[3 + 2 * i], 0);
  }
  EXPECT_EQ(host.ask(0x80, 6, 0x0303, 0x0409, 2).bytes, (Bytes{text[0], 3}));
  EXPECT_EQ(host.ask(0x80, 6, 0x03EE, 0x0409, 255).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x80, 6, 0x0303, 0x0407, 255).kind, Kind::stall) << "no German";
}

TEST(UsbUnit, ReportsByInterruptAndByControl) {
  UsbHost host;
  host.configure();
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::nothing_yet);
  const auto reply = host.exchange(device::Command::identify);
  const auto identity = device::decode_identity(reply.payload);
  ASSERT_OK(identity);
  EXPECT_EQ(identity->serial, host.plugged->unit.truth().serial);

  // The same request by SET_REPORT, its reply by the endpoint and once more by GET_REPORT.
  const auto report =
      device::encode({device::ReportKind::request, 900, device::Command::get_filter, {}, {}});
  EXPECT_EQ(host.ask(0x21, 9, 0x0200, 0, 64, Bytes(report.begin(), report.end())).kind, Kind::done);
  const UsbAnswer answer = host.usb.in(0x81, 64);
  ASSERT_EQ(answer.kind, Kind::done);
  EXPECT_EQ(device::decode(answer.bytes)->sequence, 900);
  EXPECT_EQ(host.ask(0xA1, 1, 0x0100, 0, 64).bytes, answer.bytes);
  EXPECT_EQ(host.ask(0x21, 9, 0x0200, 0, 63, Bytes(63)).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x21, 9, 0x0200, 0, 64, Bytes(10)).kind, Kind::stall) << "data cut short";

  EXPECT_EQ(host.usb.out(0x01, report).kind, Kind::done);
  EXPECT_EQ(host.usb.in(0x81, 63).kind, Kind::overflow);
}

TEST(UsbUnit, StreamsAsTimePassesAndStopsWhenTheCableIsOut) {
  UsbHost host;
  host.configure();
  host.exchange(device::Command::start_stream,
                device::PayloadWriter().put(std::uint16_t{100}).take());
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::nothing_yet);
  const auto due = host.usb.next_due();
  ASSERT_TRUE(due.has_value());
  EXPECT_GT(*due, host.clock->elapsed());
  host.clock->sleep(*due - host.clock->elapsed());
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::done);
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::nothing_yet);

  host.usb.unplug();
  EXPECT_FALSE(host.usb.is_plugged());
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::gone);
  EXPECT_EQ(host.ask(0x80, 6, 0x0100, 0, 18).kind, Kind::gone);
  host.usb.plug_in();
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{0}) << "unconfigured";
  EXPECT_FALSE(host.usb.next_due().has_value()) << "there is no stream";
}

// 60 s at 100 Hz; what comes by USB is what the unit holds, cut in any way a host may choose.
TEST(UsbUnit, DownloadsInTransfersOfAnySize) {
  UsbHost host;
  host.configure();
  host.exchange(device::Command::start_recording,
                device::PayloadWriter().put(std::uint16_t{100}).put(std::uint32_t{0}).take());
  host.clock->sleep(std::chrono::seconds(60));
  host.exchange(device::Command::stop_recording);
  const Bytes& image = host.plugged->unit.recordings().front();
  for (const std::size_t length : {512U, 1024U, 16384U, 16896U, 1U << 20U}) {
    host.exchange(device::Command::download, device::PayloadWriter()
                                                 .put(std::uint16_t{1})
                                                 .put(std::uint64_t{0})
                                                 .put(static_cast<std::uint32_t>(image.size()))
                                                 .take());
    Bytes block;
    Bytes all;
    for (;;) {
      const UsbAnswer answer = host.usb.in(0x82, length);
      if (answer.kind != Kind::done) {
        EXPECT_EQ(answer.kind, Kind::nothing_yet);
        break;
      }
      EXPECT_LE(answer.bytes.size(), length);
      block.insert(block.end(), answer.bytes.begin(), answer.bytes.end());
      if (answer.bytes.size() < length || answer.bytes.size() % 512 != 0) {
        const auto decoded = device::decode_bulk(block);
        ASSERT_OK(decoded);
        EXPECT_EQ(decoded->offset, all.size());
        all.insert(all.end(), decoded->content.begin(), decoded->content.end());
        block.clear();
      }
    }
    EXPECT_TRUE(all == image) << "in transfers of " << length;
  }
  // A request that ends another leaves nothing of it on the way.
  const auto request = [&](std::uint64_t offset) {
    host.exchange(
        device::Command::download,
        device::PayloadWriter().put(std::uint16_t{1}).put(offset).put(std::uint32_t{600}).take());
  };
  request(0);
  EXPECT_EQ(host.usb.in(0x82, 512).bytes.size(), 512U);
  request(100);
  const auto decoded = device::decode_bulk(host.usb.in(0x82, 16408).bytes);
  ASSERT_OK(decoded);
  EXPECT_EQ(decoded->offset, 100U);
  request(0);
  EXPECT_EQ(host.usb.in(0x82, 100).kind, Kind::overflow) << "a packet is longer than the buffer";
}

}  // namespace
}  // namespace sixpoint::mocks
