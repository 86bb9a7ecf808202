// The reports' interface against devices that stall, take nothing or send without end.
#include "device/usb/hid_transport.h"

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <thread>

#include <gtest/gtest.h>

#include "device/wire/protocol.h"
#include "expect_result.h"
#include "usb/misbehaving.h"

namespace sixpoint::tests {
namespace {

using mocks::UsbAnswer;
using std::chrono::milliseconds;
using std::chrono::seconds;

class HidTransport : public Misbehaving {
 protected:
  // The reports alone, of the unit as it is set now.
  Result<std::unique_ptr<device::Transport>> open_reports() {
    SIXPOINT_ASSIGN(nodes, bus->plug_in(wilful));
    SIXPOINT_ASSIGN(const auto found, device::attached_devices());
    return device::open_hid_transport(found.at(0).hidraw_node);
  }
};

TEST_F(HidTransport, AStalledReportIsAnIoError) {
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    return endpoint == device::kHidOutEndpoint ? std::optional(UsbAnswer::stall()) : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  EXPECT_FAILS(link->reports->write(Bytes(64), seconds(1)), ErrorCode::io);
}

// A device that takes no report holds a hidraw write for five seconds; the program does not wait.
TEST_F(HidTransport, ADeviceThatTakesNothingHoldsNobody) {
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    return endpoint == device::kHidOutEndpoint ? std::optional(UsbAnswer::nothing_yet())
                                               : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  EXPECT_FAILS(link->reports->write(Bytes(64), milliseconds(50)), ErrorCode::io);
  EXPECT_FAILS(link->reports->write(Bytes(64), milliseconds(50)), ErrorCode::io);
  *link = {};  // ends although the kernel still has the first
}

// Reports that are not read fill the queue, and no more than that. On a busy machine the last of
// the flood is still on its way when reading begins, and takes a place that became free: then once
// more, with a longer wait. A queue without a limit would hold all 60 every time.
TEST_F(HidTransport, AFloodFillsTheQueueAndNothingElse) {
  constexpr int kFlood = 60;
  std::atomic<int> flood = 0;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    if (endpoint != device::kHidInEndpoint) {
      return std::nullopt;
    }
    return flood-- > 0 ? UsbAnswer::done(Bytes(64, 1)) : UsbAnswer::nothing_yet();
  };
  ASSERT_OK(bus->plug_in(wilful));
  const auto found = device::attached_devices();
  ASSERT_OK(found);
  ASSERT_EQ(found->size(), 1U);
  device::HidTransportOptions options;
  options.waiting_reports = 10;
  int count = kFlood;
  for (const auto wait : {milliseconds(100), milliseconds(1'000), milliseconds(10'000)}) {
    auto reports = device::open_hid_transport(found->front().hidraw_node, options);
    ASSERT_OK(reports);
    flood = kFlood;
    while (flood > 0) {
      std::this_thread::sleep_for(milliseconds(5));
    }
    std::this_thread::sleep_for(wait);
    Bytes buffer(device::kReportBytes);
    count = 0;
    while ((*reports)->read(buffer, milliseconds(100)).value_or(0) == device::kReportBytes) {
      ++count;
    }
    ASSERT_GE(count, 10);
    if (count == 10) {
      break;
    }
  }
  EXPECT_EQ(count, 10);
}

// Oracle: what the device sent: 64 bytes each, in order, none lost and none twice.
TEST_F(HidTransport, ReportsComeInTheOrderInWhichTheDeviceSentThem) {
  constexpr int kReports = 60;  // fewer than the 64 that the kernel keeps for a slow reader
  std::atomic<int> sent = 0;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    if (endpoint != device::kHidInEndpoint) {
      return std::nullopt;
    }
    return sent < kReports ? UsbAnswer::done(Bytes(64, static_cast<std::uint8_t>(sent++)))
                           : UsbAnswer::nothing_yet();
  };
  auto reports = open_reports();
  ASSERT_OK(reports);
  Bytes buffer(device::kReportBytes);
  for (int i = 0; i < kReports; ++i) {
    const auto count = (*reports)->read(buffer, seconds(5));
    ASSERT_OK(count);
    ASSERT_EQ(*count, device::kReportBytes) << i;
    EXPECT_EQ(buffer, Bytes(device::kReportBytes, static_cast<std::uint8_t>(i)));
  }
  EXPECT_EQ(*(*reports)->read(buffer, milliseconds(20)), 0U) << "nothing came in time";
}

// A report for which the caller has no room is bad_data, and the next one is read as it is.
TEST_F(HidTransport, AReportThatDoesNotFitIsBadData) {
  std::atomic<int> sent = 0;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    if (endpoint != device::kHidInEndpoint) {
      return std::nullopt;
    }
    return sent < 2 ? UsbAnswer::done(Bytes(64, static_cast<std::uint8_t>(++sent)))
                    : UsbAnswer::nothing_yet();
  };
  auto reports = open_reports();
  ASSERT_OK(reports);
  Bytes small(10);
  EXPECT_FAILS((*reports)->read(small, seconds(5)), ErrorCode::bad_data);
  Bytes buffer(device::kReportBytes);
  ASSERT_EQ((*reports)->read(buffer, seconds(5)).value_or(0), device::kReportBytes);
  EXPECT_EQ(buffer, Bytes(device::kReportBytes, 2));
}

TEST_F(HidTransport, ANodeThatIsNotThereIsUnavailable) {
  EXPECT_FAILS(device::open_hid_transport("/dev/hidraw999"), ErrorCode::device_unavailable);
}

TEST_F(HidTransport, AfterCancelNothingIsReadOrWritten) {
  auto reports = open_reports();
  ASSERT_OK(reports);
  (*reports)->cancel();
  Bytes buffer(device::kReportBytes);
  EXPECT_FAILS((*reports)->read(buffer, seconds(5)), ErrorCode::device_unavailable);
  EXPECT_FAILS((*reports)->write(Bytes(64), seconds(5)), ErrorCode::device_unavailable);
}

// A node that is there and does not answer as hidraw, as that of a device that is just being
// unplugged: hidapi 0.13 frees memory twice where it finds that out.
TEST_F(HidTransport, ANodeOfAnotherKindIsUnavailable) {
  const auto opened = device::open_hid_transport("/dev/null");
  EXPECT_FAILS(opened, ErrorCode::device_unavailable);
  EXPECT_EQ(opened.error().where, "/dev/null");
}

// Another thread ends the write that waits for a device that takes nothing.
TEST_F(HidTransport, CancelEndsAWriteThatWaits) {
  std::atomic<int> asked = 0;
  wilful->on_out = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    asked += endpoint == device::kHidOutEndpoint ? 1 : 0;
    return endpoint == device::kHidOutEndpoint ? std::optional(UsbAnswer::nothing_yet())
                                               : std::nullopt;
  };
  auto reports = open_reports();
  ASSERT_OK(reports);
  auto writing = std::async(std::launch::async,
                            [&] { return (*reports)->write(Bytes(64), std::chrono::hours(1)); });
  while (asked == 0) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  (*reports)->cancel();
  EXPECT_FAILS(writing.get(), ErrorCode::device_unavailable);
}

TEST_F(HidTransport, AfterUnpluggingNothingIsReadOrWritten) {
  auto reports = open_reports();
  ASSERT_OK(reports);
  bus->unplug(nodes.port);
  Bytes buffer(device::kReportBytes);
  EXPECT_FAILS((*reports)->read(buffer, std::chrono::hours(1)), ErrorCode::device_unavailable);
  EXPECT_FAILS((*reports)->read(buffer, seconds(5)), ErrorCode::device_unavailable);
  EXPECT_FAILS((*reports)->write(Bytes(64), seconds(5)), ErrorCode::device_unavailable);
}

}  // namespace
}  // namespace sixpoint::tests
