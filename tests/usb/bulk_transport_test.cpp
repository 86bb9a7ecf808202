// The bulk interface against devices that stall, send too much or hang.
#include "device/usb/bulk_transport.h"

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "base/sha256.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/usb/usb_jig.h"
#include "temporary_folder.h"
#include "usb/misbehaving.h"
#include "usb/plugged.h"

namespace sixpoint::tests {
namespace {

using mocks::UsbAnswer;
using std::chrono::milliseconds;
using std::chrono::seconds;

class BulkTransport : public Misbehaving {
 protected:
  // The bulk interface alone, of the unit as it is set now.
  Result<std::unique_ptr<device::Transport>> open_bulk() {
    SIXPOINT_ASSIGN(nodes, bus->plug_in(wilful));
    SIXPOINT_ASSIGN(const auto found, device::attached_devices());
    return device::open_bulk_transport({found.at(0).bus, found.at(0).address},
                                       found.at(0).usb_node);
  }
};

TEST_F(BulkTransport, AStalledBulkEndpointIsClearedAndTheDownloadGoesOn) {
  std::atomic<int> stalls = 3;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    const bool now = endpoint == device::kBulkInEndpoint && stalls > 0;
    stalls -= now ? 1 : 0;
    return now ? std::optional(UsbAnswer::stall()) : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  Bytes buffer(device::kBulkBlockBytes);
  const auto stalled = link->bulk->read(buffer, seconds(2));
  EXPECT_FAILS(stalled, ErrorCode::io);
  EXPECT_NE(stalled.error().what.find("stalled"), std::string::npos) << stalled.error().brief();
  EXPECT_GE(wilful->cleared_halts, 1);
  stalls = 2;
  device::WireOptions options;
  options.reply_time_out = seconds(5);
  auto opened = device::WireUnit::open(std::move(*link), options);
  ASSERT_OK(opened);
  ASSERT_OK((*opened)->start_recording(100, from_unix_seconds(1'500'000'000)));
  unit.clock->forward(seconds(600));
  ASSERT_OK((*opened)->stop_recording());
  const auto list = (*opened)->recordings();
  ASSERT_OK(list);
  TemporaryFolder folder;
  ASSERT_OK((*opened)->download(list->front(), posix_env().files, folder / "x.gt3x"));
  EXPECT_EQ(sha256(*read_file(posix_env().files, folder / "x.gt3x")), list->front().sha256);
  EXPECT_EQ(stalls, 0);
}

TEST_F(BulkTransport, ATransferLongerThanAnyBlockIsBadData) {
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    return endpoint == device::kBulkInEndpoint
               ? std::optional(UsbAnswer::done(Bytes(device::kBulkBlockBytes + 200)))
               : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  Bytes buffer(device::kBulkBlockBytes);
  EXPECT_FAILS(link->bulk->read(buffer, seconds(2)), ErrorCode::bad_data);
}

// A download whose blocks stop coming, with a patience of an hour: cancel() and the end of the unit
// do not wait for the transfers that hang (bench/usb_bench measures how long they take).
TEST_F(BulkTransport, AHangingDownloadIsStopped) {
  std::atomic<bool> hang = false;
  std::atomic<int> asked = 0;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    const bool now = endpoint == device::kBulkInEndpoint && hang;
    asked += now ? 1 : 0;
    return now ? std::optional(UsbAnswer::nothing_yet()) : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  device::WireOptions options;
  options.reply_time_out = seconds(5);
  options.bulk_time_out = std::chrono::hours(1);
  auto opened = device::WireUnit::open(std::move(*link), options);
  ASSERT_OK(opened);
  const auto info = record(unit, **opened, seconds(600));
  ASSERT_OK(info);
  hang = true;
  TemporaryFolder folder;
  auto downloading = std::async(std::launch::async, [&] {
    return (*opened)->download(*info, posix_env().files, folder / "x.gt3x");
  });
  while (asked == 0) {
    std::this_thread::sleep_for(milliseconds(5));
  }
  (*opened)->cancel();
  EXPECT_FAILS(downloading.get(), ErrorCode::device_unavailable);
  opened->reset();
  EXPECT_FALSE(posix_env().files.info(folder / "x.gt3x"));
  // Without cancel(): the unit ends while its transfers hang, and the reports with them.
  auto reports_too = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    return endpoint == device::kHidOutEndpoint ? std::optional(UsbAnswer::nothing_yet())
                                               : std::nullopt;
  };
  bus->unplug(nodes.port);
  wilful->on_out = reports_too;
  wilful->plug_in();
  auto again = open();
  ASSERT_OK(again);
  Bytes buffer(device::kBulkBlockBytes);
  EXPECT_EQ(*again->bulk->read(buffer, milliseconds(20)), 0U) << "transfers are under way";
  EXPECT_FAILS(again->reports->write(Bytes(64), milliseconds(20)), ErrorCode::io);
  *again = {};
}

// Oracle: bulk_transport.h: read() delivers what one transfer brought, byte for byte and in order,
// and nothing is joined.
TEST_F(BulkTransport, EachTransferIsDeliveredAsItCame) {
  const std::vector<std::size_t> kLengths = {1, 63, 64, 65, 511, 512, 513, 4000};
  std::atomic<std::size_t> sent = 0;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    if (endpoint != device::kBulkInEndpoint) {
      return std::nullopt;
    }
    const std::size_t number = sent++;
    if (number >= kLengths.size()) {
      return UsbAnswer::nothing_yet();
    }
    return UsbAnswer::done(Bytes(kLengths[number], static_cast<std::uint8_t>(number + 1)));
  };
  auto bulk = open_bulk();
  ASSERT_OK(bulk);
  Bytes buffer(device::kBulkBlockBytes);
  for (std::size_t i = 0; i < kLengths.size(); ++i) {
    const auto count = (*bulk)->read(buffer, seconds(5));
    ASSERT_OK(count);
    EXPECT_EQ(*count, kLengths[i]);
    EXPECT_EQ(Bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(*count)),
              Bytes(kLengths[i], static_cast<std::uint8_t>(i + 1)));
  }
  EXPECT_EQ(*(*bulk)->read(buffer, milliseconds(20)), 0U) << "nothing came in time";
}

// Oracle: what the device got.
TEST_F(BulkTransport, WhatIsWrittenReachesTheDevice) {
  std::atomic<int> taken = 0;
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    taken += endpoint == device::kBulkOutEndpoint ? 1 : 0;
    return endpoint == device::kBulkOutEndpoint ? std::optional(UsbAnswer::done({})) : std::nullopt;
  };
  auto bulk = open_bulk();
  ASSERT_OK(bulk);
  EXPECT_OK((*bulk)->write(Bytes(100, 7), seconds(5)));
  EXPECT_EQ(taken, 1);
}

TEST_F(BulkTransport, ASecondOpenerIsToldThatTheInterfaceIsTaken) {
  auto first = open_bulk();
  ASSERT_OK(first);
  const auto found = device::attached_devices();
  ASSERT_OK(found);
  const device::UsbLocation place{found->at(0).bus, found->at(0).address};
  const auto second = device::open_bulk_transport(place, "the node");
  EXPECT_FAILS(second, ErrorCode::device_unavailable);
  EXPECT_EQ(second.error().where, "the node");
  first->reset();
  EXPECT_OK(device::open_bulk_transport(place, "the node"));
}

TEST_F(BulkTransport, WhereNoDeviceIsThereIsNothingToOpen) {
  EXPECT_FAILS(device::open_bulk_transport({99, 99}, "/dev/bus/usb/099/099"),
               ErrorCode::device_unavailable);
}

// What the device does not take is said, and what it takes later goes through as before.
TEST_F(BulkTransport, WhatTheDeviceDoesNotTakeIsAnIoError) {
  std::atomic<UsbAnswer::Kind> answer = UsbAnswer::Kind::stall;
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    return endpoint == device::kBulkOutEndpoint ? std::optional(UsbAnswer{answer, {}})
                                                : std::nullopt;
  };
  auto bulk = open_bulk();
  ASSERT_OK(bulk);
  const Status stalled = (*bulk)->write(Bytes(100), seconds(5));
  EXPECT_FAILS(stalled, ErrorCode::io);
  EXPECT_THAT(stalled.error().what, testing::HasSubstr("stalled"));
  answer = UsbAnswer::Kind::nothing_yet;
  for (int i = 0; i < 2; ++i) {
    const Status silent = (*bulk)->write(Bytes(100), milliseconds(20));
    EXPECT_FAILS(silent, ErrorCode::io);
    EXPECT_THAT(silent.error().what, testing::HasSubstr("did not take it in time"));
  }
  answer = UsbAnswer::Kind::done;
  EXPECT_OK((*bulk)->write(Bytes(100), seconds(5)));
  EXPECT_OK((*bulk)->write(Bytes(), seconds(5))) << "a packet without bytes";
}

TEST_F(BulkTransport, AfterUnpluggingNothingIsReadOrWritten) {
  auto bulk = open_bulk();
  ASSERT_OK(bulk);
  Bytes buffer(device::kBulkBlockBytes);
  EXPECT_EQ(*(*bulk)->read(buffer, milliseconds(1)), 0U);
  bus->unplug(nodes.port);
  EXPECT_FAILS((*bulk)->write(Bytes(10), seconds(5)), ErrorCode::device_unavailable);
  // One answer for each transfer that was under way, and then for each that cannot be any more.
  for (int i = 0; i < 2 * device::BulkTransportOptions{}.transfers; ++i) {
    EXPECT_FAILS((*bulk)->read(buffer, seconds(5)), ErrorCode::device_unavailable);
  }
}

TEST_F(BulkTransport, AfterCancelNothingIsReadOrWritten) {
  std::atomic<int> asked = 0;
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    asked += endpoint == device::kBulkOutEndpoint ? 1 : 0;
    return endpoint == device::kBulkOutEndpoint ? std::optional(UsbAnswer::nothing_yet())
                                                : std::nullopt;
  };
  auto bulk = open_bulk();
  ASSERT_OK(bulk);
  auto writing = std::async(std::launch::async,
                            [&] { return (*bulk)->write(Bytes(100), std::chrono::hours(1)); });
  while (asked == 0) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  (*bulk)->cancel();
  EXPECT_FAILS(writing.get(), ErrorCode::device_unavailable);
  Bytes buffer(device::kBulkBlockBytes);
  EXPECT_FAILS((*bulk)->read(buffer, seconds(5)), ErrorCode::device_unavailable);
  EXPECT_FAILS((*bulk)->write(Bytes(100), seconds(5)), ErrorCode::device_unavailable);
}

// A jig has reports and nothing else.
TEST_F(BulkTransport, ADeviceWithoutABulkInterfaceIsRefusedByName) {
  wilful->own_descriptors = mocks::UsbJig({}, nullptr, unit.clock).descriptors();
  ASSERT_OK(bus->plug_in(wilful));
  device::DiscoveryFilter jigs;
  jigs.product_ids = {device::kJigProductId};
  const auto found = device::attached_devices(jigs);
  ASSERT_OK(found);
  const auto bulk =
      device::open_bulk_transport({found->at(0).bus, found->at(0).address}, "the node");
  EXPECT_FAILS(bulk, ErrorCode::bad_data);
  EXPECT_EQ(bulk.error().what, "the device has no bulk interface");
}

// At least one transfer is under way, whatever the options say.
TEST_F(BulkTransport, WithoutTransfersInItsOptionsItReadsOneAtATime) {
  std::atomic<int> left = 3;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    if (endpoint != device::kBulkInEndpoint) {
      return std::nullopt;
    }
    return left-- > 0 ? UsbAnswer::done(Bytes(10, 7)) : UsbAnswer::nothing_yet();
  };
  ASSERT_OK(bus->plug_in(wilful));
  const auto found = device::attached_devices();
  ASSERT_OK(found);
  auto bulk =
      device::open_bulk_transport({found->at(0).bus, found->at(0).address}, "the node", {0});
  ASSERT_OK(bulk);
  Bytes buffer(device::kBulkBlockBytes);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(*(*bulk)->read(buffer, seconds(5)), 10U);
  }
  EXPECT_EQ(*(*bulk)->read(buffer, milliseconds(1)), 0U);
}

}  // namespace
}  // namespace sixpoint::tests
