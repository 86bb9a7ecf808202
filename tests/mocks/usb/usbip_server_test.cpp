#include "mocks/usb/usbip_server.h"

#include <csignal>
#include <fstream>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "base/env.h"
#include "base/memory_env.h"
#include "base/random.h"
#include "device/wire/payload.h"
#include "device/wire/protocol.h"
#include "expect_result.h"
#include "mocks/usb/usb_unit.h"
#include "usbip_client.h"
#include "usbip_messages.h"

namespace sixpoint::mocks {
namespace {

using tests::UsbipClient;
using Data = UsbipClient::Data;
using tests::request_report;
using tests::submit_header;

constexpr std::int32_t kPipe = -32;
constexpr std::int32_t kOverflow = -75;
constexpr std::int32_t kConnectionReset = -104;
constexpr std::int32_t kShutdown = -108;

struct ServerBench {
  explicit ServerBench(int count = 1, UsbipLimits limits = {}) {
    const auto clock = device::borrow_clock(posix_env().clock);
    std::vector<std::shared_ptr<UsbDevice>> devices;
    for (int i = 0; i < count; ++i) {
      VirtualUnitOptions options;
      options.truth = sim::draw_unit(static_cast<std::uint64_t>(7 + i));
      plugged.push_back(std::make_shared<PluggedUnit>(std::move(options), clock));
      units.push_back(std::make_shared<UsbUnit>(plugged.back()));
      devices.push_back(units.back());
    }
    server = *UsbipServer::listen(devices, {.port = 0, .limits = limits});
    thread = std::thread([this] { status = server->run(); });
  }
  ~ServerBench() {
    server->stop();
    thread.join();
    EXPECT_TRUE(status.has_value());
  }
  UsbipClient connect() const { return UsbipClient(server->port()); }

  std::vector<std::shared_ptr<PluggedUnit>> plugged;
  std::vector<std::shared_ptr<UsbUnit>> units;
  std::unique_ptr<UsbipServer> server;
  std::thread thread;
  Status status;
};

// Layout and meaning: Linux, Documentation/usb/usbip_protocol.rst.
TEST(UsbipServer, ListsItsDevices) {
  ServerBench bench(3);
  auto client = bench.connect();
  const auto devices = client.list();
  ASSERT_EQ(devices.size(), 3U);
  EXPECT_TRUE(client.is_closed()) << "one list, and the server closes";
  std::set<std::uint32_t> numbers;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].busid, "1-" + std::to_string(i + 1));
    EXPECT_EQ(devices[i].path.substr(devices[i].path.size() - 3), devices[i].busid);
    EXPECT_EQ(devices[i].speed, 3U);
    EXPECT_EQ(devices[i].vendor, 0x1209);
    EXPECT_EQ(devices[i].product, 0x0001);
    EXPECT_EQ(devices[i].configuration, 1);
    EXPECT_EQ(devices[i].configurations, 1);
    EXPECT_EQ(devices[i].classes, (std::vector<std::uint32_t>{0x030000, 0xFF0000, 0x080650}));
    numbers.insert(devices[i].device);
  }
  EXPECT_EQ(numbers.size(), 3U);
}

TEST(UsbipServer, ADeviceHasOneClientAtATime) {
  ServerBench bench(2);
  {
    auto first = bench.connect();
    ASSERT_EQ(first.import("1-1"), 0U);
    auto second = bench.connect();
    EXPECT_EQ(second.import("1-1"), 2U) << "busy";
    EXPECT_TRUE(second.is_closed());
    auto third = bench.connect();
    EXPECT_EQ(third.import("1-2"), 0U);
    auto fourth = bench.connect();
    EXPECT_EQ(fourth.import("9-9"), 4U) << "no such device";
    EXPECT_EQ(bench.connect().list().size(), 2U);
    // Set something that the next client must not find.
    EXPECT_EQ(first.control(0x02, 3, 0, 0x82, 0).status, 0);
    first.submit(1, true, 64);  // stays under way
  }
  // The server sees the end of the connection a little later.
  for (int i = 0;; ++i) {
    auto again = bench.connect();
    if (again.import("1-1") == 0) {
      EXPECT_EQ(again.control(0x82, 0, 0, 0x82, 2).data, (Data{0, 0}));
      break;
    }
    ASSERT_LT(i, 1000);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

TEST(UsbipServer, ControlRequestsTruncateAndStall) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  const auto device = client.control(0x80, 6, 0x0100, 0, 18);
  EXPECT_EQ(device.status, 0);
  EXPECT_EQ(device.data.size(), 18U);
  EXPECT_EQ(client.control(0x80, 6, 0x0100, 0, 8).data,
            Data(device.data.begin(), device.data.begin() + 8));
  EXPECT_EQ(client.control(0x80, 6, 0x0200, 0, 4096).data.size(), 87U);
  EXPECT_EQ(client.control(0x80, 6, 0x0300, 0, 255).data, (Data{4, 3, 9, 4}));
  EXPECT_EQ(client.control(0x80, 8, 0, 0, 1).data, Data{1}) << "configured by the exporting host";
  EXPECT_EQ(client.control(0x00, 9, 0, 0, 0).status, 0);
  EXPECT_EQ(client.control(0x80, 8, 0, 0, 1).data, Data{0});
  EXPECT_EQ(client.in(1, 64).status, kPipe);
  EXPECT_EQ(client.control(0x00, 9, 1, 0, 0).status, 0);
  const auto stall = client.control(0x80, 6, 0x03EE, 0x0409, 255);
  EXPECT_EQ(stall.status, kPipe);
  EXPECT_EQ(stall.length, 0U);
  EXPECT_EQ(client.in(9, 64).status, kPipe) << "no such endpoint";
  EXPECT_EQ(client.control(0x80, 6, 0x0100, 0, 18).status, 0) << "and goes on";
  // URB_SHORT_NOT_OK.
  client.submit(0, true, 64, {}, {0x80, 6, 0, 1, 0, 0, 64, 0}, 1);
  const auto brief = client.reply();
  EXPECT_EQ(brief->status, -121);
  EXPECT_EQ(brief->length, 18U);
}

TEST(UsbipServer, ReportsWaitUntilTheUnitHasOne) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  const auto waiting = client.submit(1, true, 64);
  const auto second = client.submit(1, true, 64);
  const auto asked = client.submit(1, false, 0, request_report(device::Command::identify, 5));
  std::map<std::uint32_t, UsbipClient::Reply> replies;
  for (int i = 0; i < 2; ++i) {
    const auto reply = client.reply().value();
    replies[reply.sequence] = reply;
  }
  ASSERT_TRUE(replies.contains(asked));
  EXPECT_EQ(replies[asked].status, 0);
  EXPECT_EQ(replies[asked].length, 64U);
  ASSERT_TRUE(replies.contains(waiting)) << "requests are served in their order";
  const auto identity = device::decode_identity(device::decode(replies[waiting].data)->payload);
  ASSERT_OK(identity);
  EXPECT_EQ(identity->serial, bench.plugged[0]->unit.truth().serial);

  const auto unlink = client.unlink(second);
  const auto unlinked = client.reply().value();
  EXPECT_EQ(unlinked.command, 4U);
  EXPECT_EQ(unlinked.sequence, unlink);
  EXPECT_EQ(unlinked.status, kConnectionReset);
  client.unlink(second);
  EXPECT_EQ(client.reply()->status, 0) << "there is nothing to take back any more";

  client.submit(1, false, 0, request_report(device::Command::get_filter, 6));
  client.reply();
  EXPECT_EQ(client.in(1, 63).status, kOverflow);
}

// The unit's clock is the machine's: samples come by themselves.
TEST(UsbipServer, SamplesStreamInOrder) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  client.out(1, request_report(device::Command::start_stream, 1,
                               device::PayloadWriter().put(std::uint16_t{100}).take()));
  client.in(1, 64);
  for (std::uint16_t i = 0; i < 5; ++i) {
    const auto message = device::decode(client.in(1, 64).data);
    ASSERT_OK(message);
    const auto block = device::decode_samples(*message);
    ASSERT_OK(block);
    EXPECT_EQ(block->sequence, i);
    EXPECT_EQ(block->first_index, i * 6U);
  }
}

TEST(UsbipServer, ReadsTheVolumeOverTheWire) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  EXPECT_EQ(client.control(0xA1, 0xFE, 0, 2, 1).data, Data{0});
  Data command = {'U', 'S', 'B',  'C', 1, 0, 0, 0, 0, 0, 1,   0, 0x80,
                  0,   10,  0x28, 0,   0, 0, 0, 0, 0, 0, 128, 0};
  command.resize(31, 0);
  EXPECT_EQ(client.out(3, command).status, 0);
  const auto data = client.in(3, 65536);
  ASSERT_EQ(data.data.size(), 65536U);
  EXPECT_EQ(data.data[510], 0x55);
  const auto status = client.in(3, 13);
  EXPECT_EQ(status.data, (Data{'U', 'S', 'B', 'S', 1, 0, 0, 0, 0, 0, 0, 0, 0}));
  // What is below comes from the unit, byte for byte.
  std::array<std::uint8_t, kBlockBytes> block{};
  const auto volume = unit_volume(bench.plugged[0]->unit);
  ASSERT_OK(volume);
  for (std::uint32_t i = 0; i < 128; ++i) {
    volume->read(i, block);
    EXPECT_TRUE(std::equal(block.begin(), block.end(), data.data.begin() + i * 512)) << i;
  }
}

TEST(UsbipServer, UnpluggedInFlightAndPluggedAgain) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  const auto report = client.submit(1, true, 64);
  const auto bulk = client.submit(2, true, 512);
  EXPECT_EQ(client.control(0x80, 8, 0, 0, 1).status, 0) << "both wait on the server";
  bench.units[0]->unplug();
  std::set<std::uint32_t> ended;
  for (int i = 0; i < 2; ++i) {
    const auto reply = client.reply();
    ASSERT_TRUE(reply.has_value());
    EXPECT_EQ(reply->status, kShutdown);
    ended.insert(reply->sequence);
  }
  EXPECT_EQ(ended, (std::set<std::uint32_t>{report, bulk}));
  EXPECT_TRUE(client.is_closed());
  EXPECT_TRUE(bench.connect().list().empty());
  EXPECT_EQ(bench.connect().import("1-1"), 4U);
  bench.units[0]->plug_in();
  EXPECT_EQ(bench.connect().import("1-1"), 0U);
}

// ---- hostile peers ------------------------------------------------------------------------------

TEST(UsbipServer, BreachesEndTheConnectionAndNothingElse) {
  ServerBench bench;
  for (const Data& hello : {Data{0x01, 0x10, 0x80, 0x05, 0, 0, 0, 0}, Data(64, 0xFF), Data(8, 0),
                            Data{0x01, 0x11, 0x80, 0x04, 0, 0, 0, 0}}) {
    auto client = bench.connect();
    client.send(hello);
    EXPECT_TRUE(client.is_closed());
  }
  for (const Data& breach :
       {submit_header(1, 0, 2, 0xFFFFFFFF, 0), submit_header(1, 1, 2, 0x80000000, 0),
        submit_header(1, 1, 2, (16U << 20U) + 1, 0), submit_header(1, 1, 2, 512, 1),
        submit_header(1, 1, 16, 512, 0), submit_header(1, 2, 2, 512, 0),
        submit_header(3, 1, 2, 512, 0), submit_header(0, 0, 0, 0, 0)}) {
    auto client = bench.connect();
    ASSERT_EQ(client.import("1-1"), 0U) << "the device was not given back";
    client.send(breach);
    EXPECT_TRUE(client.is_closed());
  }
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  Data other_device = submit_header(1, 1, 0, 18, 0xFFFFFFFF);
  other_device[11] = 99;
  client.send(other_device);
  EXPECT_EQ(client.reply()->status, -19) << "ENODEV";
  EXPECT_EQ(client.control(0x80, 6, 0x0100, 0, 18).status, 0);
}

TEST(UsbipServer, AFloodOfRequestsIsCutOff) {
  ServerBench bench;
  auto client = bench.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  for (int i = 0; i < 5000; ++i) {
    client.submit(2, true, 512);
  }
  EXPECT_TRUE(client.is_closed());
  EXPECT_EQ(bench.connect().list().size(), 1U);
}

TEST(UsbipServer, ATakenPortIsSaid) {
  ServerBench bench;
  EXPECT_FAILS(UsbipServer::listen({}, {.port = bench.server->port(), .limits = {}}),
               ErrorCode::device_unavailable);
}

}  // namespace
}  // namespace sixpoint::mocks
