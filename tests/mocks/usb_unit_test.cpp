#include "mocks/usb_unit.h"

#include <cstring>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/payload.h"
#include "device/unit.h"
#include "device/usb_ids.h"
#include "expect_result.h"
#include "gt3x/info.h"
#include "mocks/usb_drive.h"
#include "mocks/virtual_drive.h"
#include "mocks/virtual_jig.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

struct Host {
  explicit Host(VirtualUnitOptions options = {.truth = sim::draw_unit(7)})
      : clock(std::make_shared<ManualClock>()),
        plugged(std::make_shared<PluggedUnit>(std::move(options), clock)),
        usb(plugged) {
    usb.bus_reset();
  }
  UsbAnswer ask(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                std::uint16_t length, const Bytes& data = {}) {
    return usb.control({type, request, value, index, length}, data);
  }
  void configure() { ASSERT_EQ(ask(0x00, 9, 1, 0, 0).kind, Kind::done); }
  device::Message exchange(device::Command command, Bytes payload = {}) {
    const auto report =
        device::encode({device::ReportKind::request, ++sequence, command, {}, std::move(payload)});
    EXPECT_EQ(usb.out(0x01, report).kind, Kind::done);
    const UsbAnswer reply = usb.in(0x81, 64);
    EXPECT_EQ(reply.kind, Kind::done);
    const auto message = device::decode(reply.bytes);
    EXPECT_TRUE(message.has_value());
    return message.value_or(device::Message{});
  }

  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<PluggedUnit> plugged;
  UsbUnit usb;
  std::uint16_t sequence = 0;
};

// Expected bytes are those of USB 2.0, table 9-8, HID 1.11 and docs/protocol.md, written out.
TEST(UsbUnit, DescriptorsAreTheDocumentedOnes) {
  Host host;
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
  Host host;
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

// Oracle: RFC 2781's example of U+10000 and above, and Latin letters.
TEST(UsbDevice, StringsAreUtf16) {
  UsbDescriptors usb;
  usb.strings = {{1, "\xC3\xA4"}, {2, "\xF0\x90\x80\x80"}, {3, "\xFF"}, {4, std::string(300, 'a')}};
  EXPECT_EQ(string_descriptor(usb, 1), (Bytes{4, 3, 0xE4, 0x00}));
  EXPECT_EQ(string_descriptor(usb, 2), (Bytes{6, 3, 0x00, 0xD8, 0x00, 0xDC}));
  EXPECT_EQ(string_descriptor(usb, 4).size(), 254U);
  EXPECT_EQ(string_descriptor(usb, 9), Bytes{});
}

TEST(UsbUnit, ConfigurationStatusAndInterfaces) {
  Host host;
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{0});
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::stall) << "not configured";
  EXPECT_EQ(host.ask(0x81, 10, 0, 0, 1).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x00, 9, 2, 0, 0).kind, Kind::stall);
  host.configure();
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{1});
  EXPECT_EQ(host.ask(0x80, 0, 0, 0, 2).bytes, (Bytes{1, 0})) << "self powered";
  EXPECT_EQ(host.ask(0x81, 0, 0, 2, 2).bytes, (Bytes{0, 0}));
  EXPECT_EQ(host.ask(0x81, 0, 0, 3, 2).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x81, 10, 0, 1, 1).bytes, Bytes{0});
  EXPECT_EQ(host.ask(0x01, 11, 0, 1, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0x01, 11, 1, 1, 0).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x00, 3, 1, 0, 0).kind, Kind::stall) << "no remote wakeup";
  EXPECT_EQ(host.ask(0x80, 5, 3, 0, 0).kind, Kind::stall) << "wrong direction";
  EXPECT_EQ(host.ask(0x40, 77, 0, 0, 0).kind, Kind::stall) << "no vendor requests";

  EXPECT_EQ(host.ask(0x82, 0, 0, 0x82, 2).bytes, (Bytes{0, 0}));
  EXPECT_EQ(host.ask(0x02, 3, 0, 0x82, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0x82, 0, 0, 0x82, 2).bytes, (Bytes{1, 0}));
  EXPECT_EQ(host.usb.in(0x82, 512).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x02, 1, 0, 0x82, 0).kind, Kind::done);
  EXPECT_EQ(host.usb.in(0x82, 512).kind, Kind::nothing_yet);
  EXPECT_EQ(host.ask(0x82, 0, 0, 0x85, 2).kind, Kind::stall) << "no such endpoint";

  EXPECT_EQ(host.ask(0x21, 10, 0x0400, 0, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0xA1, 2, 0, 0, 1).bytes, Bytes{4}) << "GET_IDLE gives what SET_IDLE took";
  EXPECT_EQ(host.ask(0x21, 10, 0, 1, 0).kind, Kind::stall) << "interface 1 is no HID";
  host.ask(0x00, 9, 0, 0, 0);
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{0});
}

TEST(UsbUnit, ReportsByInterruptAndByControl) {
  Host host;
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
  Host host;
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
  EXPECT_FALSE(host.usb.next_due().has_value()) << "nobody asked for a stream";
}

// 60 s at 100 Hz; what comes by USB is what the unit holds, cut in any way a host may choose.
TEST(UsbUnit, DownloadsInTransfersOfAnySize) {
  Host host;
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

// USB 2.0, 5.8.3: a transfer whose length is a multiple of the packet size ends with an empty
// packet.
TEST(TransferQueue, EndsOnThePacketBoundary) {
  TransferQueue queue(512);
  queue.put(Bytes(1024, 1));
  EXPECT_EQ(queue.next(512).bytes.size(), 512U);
  EXPECT_EQ(queue.next(512).bytes.size(), 512U);
  const UsbAnswer end = queue.next(512);
  EXPECT_EQ(end.kind, Kind::done);
  EXPECT_TRUE(end.bytes.empty());
  EXPECT_EQ(queue.next(512).kind, Kind::nothing_yet);
  queue.put(Bytes(1024, 1));
  EXPECT_EQ(queue.next(4096).bytes.size(), 1024U);
  EXPECT_EQ(queue.next(512).kind, Kind::nothing_yet) << "the host saw the empty packet";
}

// ---- mass storage -----------------------------------------------------------------------------

struct Answer {
  Bytes data;
  bool stalled = false;
  int status = -1;
  std::uint32_t residue = 0;
};

// A host's bulk-only transport, written from the specification.
struct Disk {
  explicit Disk(UsbDevice& device) : usb(device) {}
  Bytes command_block(const Bytes& command, std::uint32_t length, bool in) {
    Bytes block = {'U', 'S', 'B', 'C'};
    ++tag;
    for (const std::uint32_t value : {tag, length}) {
      for (unsigned i = 0; i < 4; ++i) {
        block.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
      }
    }
    block.insert(block.end(), {static_cast<std::uint8_t>(in ? 0x80 : 0), 0,
                               static_cast<std::uint8_t>(command.size())});
    block.insert(block.end(), command.begin(), command.end());
    block.resize(31, 0);
    return block;
  }
  Answer run(const Bytes& command, std::uint32_t length, bool in = true) {
    Answer answer;
    EXPECT_EQ(usb.out(0x03, command_block(command, length, in)).kind, Kind::done);
    if (length != 0 && in) {
      const UsbAnswer data = usb.in(0x83, length);
      answer.stalled = data.kind == Kind::stall;
      answer.data = data.bytes;
    } else if (length != 0) {
      EXPECT_EQ(usb.out(0x03, Bytes(length, 0xEE)).kind, Kind::done);
    }
    UsbAnswer status = usb.in(0x83, 13);
    if (status.kind == Kind::stall) {
      answer.stalled = true;
      usb.control({0x02, 1, 0, 0x83, 0}, {});
      status = usb.in(0x83, 13);
    }
    if (status.kind != Kind::done || status.bytes.size() != 13 ||
        std::memcmp(status.bytes.data(), "USBS", 4) != 0) {
      return answer;
    }
    EXPECT_EQ(status.bytes[4] | (status.bytes[5] << 8), static_cast<int>(tag & 0xFFFFU));
    for (unsigned i = 0; i < 4; ++i) {
      answer.residue |= static_cast<std::uint32_t>(status.bytes[8 + i]) << (8 * i);
    }
    answer.status = status.bytes[12];
    return answer;
  }
  Bytes sense() {
    const Bytes data = run({3, 0, 0, 0, 18, 0}, 18).data;
    return data.size() == 18 ? Bytes{data[2], data[12], data[13]} : Bytes{};
  }
  Bytes read(std::uint32_t block, std::uint16_t count) {
    const auto byte = [](std::uint32_t value, unsigned shift) {
      return static_cast<std::uint8_t>(value >> shift);
    };
    return run({0x28, 0, byte(block, 24), byte(block, 16), byte(block, 8), byte(block, 0), 0,
                byte(count, 8), byte(count, 0), 0},
               std::uint32_t{count} * 512)
        .data;
  }
  UsbDevice& usb;
  std::uint32_t tag = 0;
};

TEST(UsbUnit, MassStorageAnswersAHost) {
  Host host;
  host.configure();
  Disk disk(host.usb);
  EXPECT_EQ(host.ask(0xA1, 0xFE, 0, 2, 1).bytes, Bytes{0});
  EXPECT_EQ(host.ask(0xA1, 0xFE, 0, 1, 1).kind, Kind::stall);

  const Answer inquiry = disk.run({0x12, 0, 0, 0, 36, 0}, 36);
  ASSERT_EQ(inquiry.data.size(), 36U);
  EXPECT_EQ(inquiry.status, 0);
  EXPECT_EQ(inquiry.data[0], 0) << "a disk";
  EXPECT_EQ(inquiry.data[1], 0x80) << "removable";
  EXPECT_EQ(std::string(inquiry.data.begin() + 8, inquiry.data.end()),
            "SixpointActivity monitor1.0 ");
  EXPECT_EQ(disk.run({0x12, 0, 0, 0, 5, 0}, 5).data.size(), 5U);
  const Answer serial = disk.run({0x12, 1, 0x80, 0, 255, 0}, 255);
  EXPECT_EQ(std::string(serial.data.begin() + 4, serial.data.end()),
            host.plugged->unit.truth().serial);
  EXPECT_EQ(serial.residue, 255 - serial.data.size());

  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  const Answer capacity = disk.run({0x25, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 8);
  EXPECT_EQ(capacity.data, (Bytes{0, 0x02, 0xFF, 0xFF, 0, 0, 2, 0})) << "96 MiB in blocks of 512";
  EXPECT_EQ(disk.run({0x23, 0, 0, 0, 0, 0, 0, 0, 12, 0}, 12).data,
            (Bytes{0, 0, 0, 8, 0, 3, 0, 0, 2, 0, 2, 0}));
  const Answer mode = disk.run({0x1A, 0, 0x3F, 0, 192, 0}, 192);
  EXPECT_EQ(mode.data, (Bytes{3, 0, 0x80, 0})) << "write protected";
  EXPECT_EQ(mode.residue, 188U);
  EXPECT_EQ(disk.run({0x1E, 0, 0, 0, 1, 0}, 0).status, 0);

  const Bytes boot = disk.read(0, 1);
  ASSERT_EQ(boot.size(), 512U);
  EXPECT_EQ(boot[510], 0x55);
  EXPECT_EQ(boot[511], 0xAA);
  const Bytes four = disk.read(0, 4);
  EXPECT_TRUE(std::equal(boot.begin(), boot.end(), four.begin()));

  // Errors: sense key, code and qualifier of SPC-2.
  const Answer beyond = disk.run({0x28, 0, 0, 2, 0xFF, 0xFF, 0, 0, 2, 0}, 1024);
  EXPECT_TRUE(beyond.stalled);
  EXPECT_EQ(beyond.status, 1);
  EXPECT_EQ(beyond.residue, 1024U);
  EXPECT_EQ(disk.sense(), (Bytes{5, 0x21, 0}));
  EXPECT_EQ(disk.sense(), (Bytes{0, 0, 0})) << "told once";
  const Answer write = disk.run({0x2A, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 512, false);
  EXPECT_EQ(write.status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{7, 0x27, 0}));
  EXPECT_EQ(disk.read(0, 1), boot) << "nothing was written";
  EXPECT_EQ(disk.run({0xEE, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{5, 0x20, 0}));
}

// Bulk-only transport, 6.6 and 6.7.
TEST(UsbUnit, MassStorageHoldsToTheTransport) {
  Host host;
  host.configure();
  Disk disk(host.usb);
  EXPECT_EQ(disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 0).status, 2) << "case 2: Hn < Di";
  const Answer long_host = disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 1024);
  EXPECT_EQ(long_host.data.size(), 512U) << "case 5: Hi > Di";
  EXPECT_EQ(long_host.residue, 512U);
  EXPECT_EQ(long_host.status, 0);
  const Answer short_host = disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 2, 0}, 512);
  EXPECT_EQ(short_host.status, 2) << "case 7: Hi < Di";
  EXPECT_EQ(disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 512, false).status, 2)
      << "case 10: Ho <> Di";
  const Answer no_data = disk.run({0, 0, 0, 0, 0, 0}, 64);
  EXPECT_TRUE(no_data.stalled) << "case 4: Hi > Dn";
  EXPECT_EQ(no_data.status, 0);
  EXPECT_EQ(no_data.residue, 64U);

  // The host's buffer ends with the last packet: only a stall tells that this was all.
  EXPECT_EQ(
      host.usb.out(0x03, disk.command_block({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 2048, true)).kind,
      Kind::done);
  EXPECT_EQ(host.usb.in(0x83, 512).bytes.size(), 512U);
  EXPECT_EQ(host.usb.in(0x83, 512).kind, Kind::stall);
  host.ask(0x02, 1, 0, 0x83, 0);
  EXPECT_EQ(host.usb.in(0x83, 13).bytes.size(), 13U);

  // Nonsense halts both endpoints until the reset recovery (5.3.4).
  for (const Bytes& nonsense : {Bytes(31, 0), Bytes(30, 'U'), Bytes(512, 1), Bytes{}}) {
    EXPECT_EQ(host.usb.out(0x03, nonsense).kind, Kind::stall);
    EXPECT_EQ(host.usb.in(0x83, 13).kind, Kind::stall);
    host.ask(0x02, 1, 0, 0x83, 0);
    EXPECT_EQ(host.usb.in(0x83, 13).kind, Kind::stall) << "clearing the halt alone is not enough";
    EXPECT_EQ(host.ask(0x21, 0xFF, 0, 2, 0).kind, Kind::done);
    host.ask(0x02, 1, 0, 0x83, 0);
    host.ask(0x02, 1, 0, 0x03, 0);
    EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  }
  Bytes other_unit = disk.command_block({0, 0, 0, 0, 0, 0}, 0, true);
  other_unit[13] = 1;
  EXPECT_EQ(host.usb.out(0x03, other_unit).kind, Kind::stall) << "there is one logical unit";
}

TEST(UsbUnit, EjectedAndChangedMediaAreSaid) {
  Host host;
  host.configure();
  Disk disk(host.usb);
  EXPECT_EQ(disk.run({0x1B, 0, 0, 0, 2, 0}, 0).status, 0);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{2, 0x3A, 0}));
  EXPECT_EQ(disk.run({0x1B, 0, 0, 0, 3, 0}, 0).status, 0);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);

  host.exchange(device::Command::start_recording,
                device::PayloadWriter().put(std::uint16_t{30}).put(std::uint32_t{1000000}).take());
  host.clock->sleep(std::chrono::seconds(10));
  host.exchange(device::Command::stop_recording);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{6, 0x28, 0})) << "the volume has another content";
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
}

// The unit that offers nothing else: one interface, and the volume behind it.
TEST(UsbDrive, IsOneInterfaceWithItsVolume) {
  VirtualDriveOptions options;
  options.unit.truth = sim::draw_unit(7);
  const auto recording = virtual_drive_recording(options);
  ASSERT_OK(recording);
  VirtualUnit holder(options.unit);
  ASSERT_OK(holder.keep_recording(*recording, UtcTime{}));
  auto made = unit_volume(holder);
  ASSERT_OK(made);
  const auto volume = std::make_shared<const FatImage>(*std::move(made));
  UsbDrive drive(options.unit.truth, volume, std::make_shared<ManualClock>());
  EXPECT_EQ(drive.descriptors().product_id(), device::kFileMonitorProductId);
  EXPECT_EQ(drive.descriptors().serial(), options.unit.truth.serial);
  const auto configuration = parse_configuration(drive.descriptors().configuration);
  ASSERT_OK(configuration);
  ASSERT_EQ(configuration->interfaces.size(), 1U);
  EXPECT_EQ(configuration->interfaces[0].device_class, 8);
  EXPECT_EQ(configuration->endpoints.size(), 2U);

  drive.bus_reset();
  ASSERT_EQ(drive.control({0x00, 9, 1, 0, 0}, {}).kind, Kind::done);
  EXPECT_EQ(drive.control({0xA1, 0xFE, 0, 0, 1}, {}).bytes, Bytes{0});
  EXPECT_EQ(drive.out(0x01, Bytes(64)).kind, Kind::stall) << "no reports";
  Disk disk(drive);
  const Answer inquiry = disk.run({0x12, 0, 0, 0, 36, 0}, 36);
  EXPECT_EQ(std::string(inquiry.data.begin() + 8, inquiry.data.end()),
            "SixpointFile monitor    1.0 ");
  for (std::uint32_t block = 0; block < 2000; block += 97) {
    std::array<std::uint8_t, kBlockBytes> wanted{};
    volume->read(block, wanted);
    EXPECT_EQ(disk.read(block, 1), Bytes(wanted.begin(), wanted.end())) << block;
  }
  // Nonsense halts it until the reset recovery, as the monitor's storage.
  EXPECT_EQ(drive.out(0x03, Bytes(30, 'U')).kind, Kind::stall);
  drive.control({0x02, 1, 0, 0x83, 0}, {});
  EXPECT_EQ(drive.in(0x83, 13).kind, Kind::stall);
  EXPECT_EQ(drive.control({0x21, 0xFF, 0, 0, 0}, {}).kind, Kind::done);
  drive.control({0x02, 1, 0, 0x83, 0}, {});
  drive.control({0x02, 1, 0, 0x03, 0}, {});
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  drive.unplug();
  EXPECT_EQ(drive.in(0x83, 13).kind, Kind::gone);
}

}  // namespace
}  // namespace sixpoint::mocks
