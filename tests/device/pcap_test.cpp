#include "device/pcap.h"

#include <gtest/gtest.h>

#include "device/session_replay.h"
#include "device/usb_ids.h"
#include "made_session.h"

namespace sixpoint::device {
namespace {

// A capture as the kernel's usbmon gives it (Documentation/usb/usbmon.rst, struct usbmon_packet),
// written by its own lines: what the reader takes apart is not what put it together.
class Capture {
 public:
  Capture(std::uint32_t link_type, bool big) : big_(big), mmapped_(link_type == 220) {
    put(0xA1B2C3D4, 4);
    put(2, 2);
    put(4, 2);
    put(0, 8);
    put(262'144, 4);
    put(link_type, 4);
  }
  void add(char event, int type, int endpoint, int device, std::int64_t time_us,
           const Bytes& data) {
    const std::size_t length = (mmapped_ ? 64 : 48) + data.size();
    put(static_cast<std::uint64_t>(time_us / 1'000'000), 4);
    put(static_cast<std::uint64_t>(time_us % 1'000'000), 4);
    put(length, 4);
    put(length, 4);
    put(0xFFFF888012345678, 8);
    put(static_cast<std::uint64_t>(event), 1);
    put(static_cast<std::uint64_t>(type), 1);
    put(static_cast<std::uint64_t>(endpoint), 1);
    put(static_cast<std::uint64_t>(device), 1);
    put(3, 2);  // bus
    put('-', 1);
    put(0, 1);
    put(static_cast<std::uint64_t>(time_us / 1'000'000), 8);
    put(static_cast<std::uint64_t>(time_us % 1'000'000), 4);
    put(0, 4);
    put(data.size(), 4);
    put(data.size(), 4);
    put(0, 8);
    if (mmapped_) {
      put(0, 8);
      put(0, 8);
    }
    bytes.insert(bytes.end(), data.begin(), data.end());
  }
  Bytes bytes;

 private:
  void put(std::uint64_t value, int width) {
    for (int i = 0; i < width; ++i) {
      const int shift = 8 * (big_ ? width - 1 - i : i);
      bytes.push_back(static_cast<std::uint8_t>(shift < 64 ? (value >> shift) & 0xFFU : 0));
    }
  }
  bool big_;
  bool mmapped_;
};

Capture captured(const Session& session, std::uint32_t link_type, bool big) {
  Capture capture(link_type, big);
  std::int64_t time_us = 1'600'000'000'000'000;
  capture.add('S', 2, 0x80, 1, time_us, {1, 2, 3});    // control, of a hub
  capture.add('C', 1, 0x81, 4, time_us, Bytes(8, 7));  // a mouse
  for (const SessionTransfer& transfer : session.transfers) {
    time_us = 1'600'000'000'000'000 + transfer.time.count() / 1000;
    const bool in = transfer.kind == SessionTransfer::Kind::from_device;
    const bool bulk = transfer.channel == SessionChannel::bulk;
    const int endpoint = in ? (bulk ? kBulkInEndpoint : kHidInEndpoint)
                            : (bulk ? kBulkOutEndpoint : kHidOutEndpoint);
    capture.add('S', bulk ? 3 : 1, endpoint, 9, time_us, in ? Bytes{} : transfer.bytes);
    capture.add('C', bulk ? 3 : 1, endpoint, 9, time_us, in ? transfer.bytes : Bytes{});
    capture.add('C', 3, 0x83, 9, time_us, Bytes(512, 0));  // mass storage beside it
  }
  return capture;
}

// Oracle: the session that was captured.
TEST(Pcap, BecomesTheSessionThatWasCaptured) {
  const Session session = tests::made_session();
  for (const std::uint32_t link_type : {189U, 220U}) {
    for (const bool big : {false, true}) {
      const auto made = session_from_pcap(captured(session, link_type, big).bytes, {});
      ASSERT_OK(made);
      EXPECT_EQ(made->device, "usb bus 3 device 9");
      ASSERT_EQ(made->transfers.size(), session.transfers.size());
      for (std::size_t i = 0; i < made->transfers.size(); ++i) {
        EXPECT_EQ(made->transfers[i].bytes, session.transfers[i].bytes) << i;
        EXPECT_EQ(made->transfers[i].kind, session.transfers[i].kind) << i;
      }
      const auto unit = Unit::open(replay_link(*made, SessionMatch::strict));
      ASSERT_OK(unit);
      EXPECT_EQ((*unit)->read_calibration()->constants, sim::draw_unit(7).constants);
    }
  }
}

TEST(Pcap, RefusesWhatIsNoCaptureOfAUnit) {
  const Bytes whole = captured(tests::made_session(2), 220, false).bytes;
  EXPECT_FAILS(session_from_pcap({}, {}), ErrorCode::bad_data);
  EXPECT_FAILS(session_from_pcap(Bytes(100, 0), {}), ErrorCode::bad_data);
  EXPECT_FAILS(session_from_pcap(Capture(1, false).bytes, {}), ErrorCode::bad_data);    // Ethernet
  EXPECT_FAILS(session_from_pcap(Capture(220, false).bytes, {}), ErrorCode::bad_data);  // empty
  PcapOptions other;
  other.device = 5;
  EXPECT_FAILS(session_from_pcap(whole, other), ErrorCode::bad_data);
  // Cut anywhere: an answer, and where it is a session, a beginning of the whole one.
  const auto all = *session_from_pcap(whole, {});
  for (std::size_t size = 0; size < whole.size(); size += 3) {
    const auto made = session_from_pcap(std::span(whole).first(size), {});
    if (made) {
      ASSERT_LE(made->transfers.size(), all.transfers.size());
      EXPECT_TRUE(
          std::equal(made->transfers.begin(), made->transfers.end(), all.transfers.begin()));
    }
  }
}

}  // namespace
}  // namespace sixpoint::device
