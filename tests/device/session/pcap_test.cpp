#include "device/session/pcap.h"

#include <array>
#include <utility>

#include <gmock/gmock.h>

#include "device/session/session_replay.h"
#include "device/usb/usb_ids.h"
#include "device/wire/wire_unit.h"
#include "made_session.h"

namespace sixpoint::device {
namespace {

using testing::HasSubstr;

// Captures in every form that is read, written here from the public descriptions of the formats and
// without the reader's code.
enum class Form { microseconds, nanoseconds };

class Capture {
 public:
  Capture(Form form, std::uint32_t link_type, bool big)
      : form_(form), link_type_(link_type), big_(big) {
    // https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html, section 4
    put(form_ == Form::microseconds ? 0xA1B2C3D4 : 0xA1B23C4D, 4);
    put(2, 2);
    put(4, 2);
    put(0, 8);
    put(262'144, 4);
    put(link_type, 4);
  }

  void add(char event, int type, int endpoint, int device, std::int64_t time_ns, const Bytes& data,
           int bus = 3) {
    const Bytes packet = link_type_ == 249
                             ? usbpcap(event, type, endpoint, device, data, bus)
                             : usbmon(event, type, endpoint, device, time_ns, data, bus);
    add_packet(time_ns, packet);
  }
  Bytes bytes;

 private:
  void put(std::uint64_t value, int width) { put(bytes, value, width, big_); }
  static void put(Bytes& out, std::uint64_t value, int width, bool big) {
    for (int i = 0; i < width; ++i) {
      const int shift = 8 * (big ? width - 1 - i : i);
      out.push_back(static_cast<std::uint8_t>(shift < 64 ? (value >> shift) & 0xFFU : 0));
    }
  }

  // Documentation/usb/usbmon.rst, struct usbmon_packet; the last 16 bytes in link type 220 alone.
  Bytes usbmon(char event, int type, int endpoint, int device, std::int64_t time_ns,
               const Bytes& data, int bus) const {
    Bytes out;
    const auto field = [&](std::uint64_t value, int width) { put(out, value, width, big_); };
    field(0xFFFF888012345678, 8);
    field(static_cast<std::uint64_t>(event), 1);
    field(static_cast<std::uint64_t>(type), 1);
    field(static_cast<std::uint64_t>(endpoint), 1);
    field(static_cast<std::uint64_t>(device), 1);
    field(static_cast<std::uint64_t>(bus), 2);
    field('-', 1);
    field(0, 1);
    field(static_cast<std::uint64_t>(time_ns / 1'000'000'000), 8);
    field(static_cast<std::uint64_t>(time_ns / 1000 % 1'000'000), 4);
    field(0, 4);
    field(data.size(), 4);
    field(data.size(), 4);
    field(0, 8);
    if (link_type_ == 220) {
      field(0, 8);
      field(0, 8);
    }
    out.insert(out.end(), data.begin(), data.end());
    return out;
  }

  // https://desowin.org/usbpcap/captureformat.html, USBPCAP_BUFFER_PACKET_HEADER; a control
  // transfer has one byte more. Always little-endian.
  static Bytes usbpcap(char event, int type, int endpoint, int device, const Bytes& data, int bus) {
    Bytes out;
    const auto field = [&](std::uint64_t value, int width) { put(out, value, width, false); };
    const bool control = type == 2;
    field(control ? 28 : 27, 2);
    field(0xFFFFFA8012345678, 8);
    field(0, 4);
    field(9, 2);
    field(event == 'C' ? 1 : 0, 1);
    field(static_cast<std::uint64_t>(bus), 2);
    field(static_cast<std::uint64_t>(device), 2);
    field(static_cast<std::uint64_t>(endpoint), 1);
    field(static_cast<std::uint64_t>(type), 1);
    field(data.size(), 4);
    if (control) {
      field(0, 1);
    }
    out.insert(out.end(), data.begin(), data.end());
    return out;
  }

  void add_packet(std::int64_t time_ns, const Bytes& packet) {
    const std::int64_t rest_ns = time_ns % 1'000'000'000;
    put(static_cast<std::uint64_t>(time_ns / 1'000'000'000), 4);
    put(static_cast<std::uint64_t>(form_ == Form::microseconds ? rest_ns / 1000 : rest_ns), 4);
    put(packet.size(), 4);
    put(packet.size(), 4);
    bytes.insert(bytes.end(), packet.begin(), packet.end());
  }

  Form form_;
  std::uint32_t link_type_;
  bool big_;
};

constexpr std::int64_t kStart_ns = 1'600'000'000'000'000'000;

// The session on bus 3, device 9, among the traffic of others: a hub, a mouse, another unit on
// another bus with the same number, the unit's own mass storage.
Capture captured(const Session& session, Form form, std::uint32_t link_type, bool big) {
  Capture capture(form, link_type, big);
  capture.add('S', 2, 0x80, 1, kStart_ns, {1, 2, 3});
  capture.add('C', 1, 0x81, 4, kStart_ns, Bytes(8, 7));
  bool first = true;
  for (const SessionTransfer& transfer : session.transfers) {
    const std::int64_t time_ns = kStart_ns + transfer.time.count();
    const bool in = transfer.kind == SessionTransfer::Kind::from_device;
    const bool bulk = transfer.channel == SessionChannel::bulk;
    const int endpoint = in ? (bulk ? kBulkInEndpoint : kHidInEndpoint)
                            : (bulk ? kBulkOutEndpoint : kHidOutEndpoint);
    capture.add('S', bulk ? 3 : 1, endpoint, 9, time_ns, in ? Bytes{} : transfer.bytes);
    capture.add('C', bulk ? 3 : 1, endpoint, 9, time_ns, in ? transfer.bytes : Bytes{});
    capture.add('C', 3, 0x83, 9, time_ns, Bytes(512, 0));
    if (!std::exchange(first, false)) {
      capture.add('C', 1, kHidInEndpoint, 9, time_ns, Bytes(64, 0x55), 4);
      capture.add('C', 1, kHidInEndpoint, 10, time_ns, Bytes(64, 0x55));
    }
  }
  return capture;
}

constexpr std::array<Form, 2> kForms = {Form::microseconds, Form::nanoseconds};
constexpr std::array<std::uint32_t, 3> kLinkTypes = {189, 220, 249};

// Oracle: the session that was captured.
TEST(Pcap, EveryFormBecomesTheSessionThatWasCaptured) {
  const Session session = tests::made_session();
  for (const Form form : kForms) {
    for (const std::uint32_t link_type : kLinkTypes) {
      for (const bool big : {false, true}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(form) << ", link type " << link_type
                                        << (big ? ", big" : ", little") << "-endian");
        const auto made = session_from_pcap(captured(session, form, link_type, big).bytes, {});
        ASSERT_OK(made);
        EXPECT_EQ(made->device, "usb bus 3 device 9");
        EXPECT_NEAR(std::chrono::duration<double>(made->started.time_since_epoch()).count(), 1.6e9,
                    1);
        ASSERT_EQ(made->transfers.size(), session.transfers.size());
        for (std::size_t i = 0; i < made->transfers.size(); ++i) {
          EXPECT_EQ(made->transfers[i].bytes, session.transfers[i].bytes) << i;
          EXPECT_EQ(made->transfers[i].kind, session.transfers[i].kind) << i;
          // Clocks of a microsecond, two times.
          const auto off = made->transfers[i].time - session.transfers[i].time;
          EXPECT_LE(std::abs(off.count()), 2000) << i;
        }
        const auto unit = WireUnit::open(replay_link(*made, SessionMatch::strict));
        ASSERT_OK(unit);
        EXPECT_EQ((*unit)->read_calibration()->constants, sim::draw_unit(7).constants);
      }
    }
  }
}

// Cut anywhere: an answer, and where it is a session, a beginning of the whole one.
TEST(Pcap, ACaptureThatWasCutIsABeginning) {
  for (const Form form : kForms) {
    for (const std::uint32_t link_type : {220U, 249U}) {
      const Bytes whole = captured(tests::made_session(2), form, link_type, false).bytes;
      const auto all = *session_from_pcap(whole, {});
      int beginnings = 0;
      for (std::size_t size = 0; size < whole.size(); size += 3) {
        const auto made = session_from_pcap(std::span(whole).first(size), {});
        if (made) {
          ASSERT_LE(made->transfers.size(), all.transfers.size());
          EXPECT_TRUE(
              std::equal(made->transfers.begin(), made->transfers.end(), all.transfers.begin()));
          ++beginnings;
        }
      }
      EXPECT_GT(beginnings, 100);
    }
  }
}

// Wrong lengths and counts in a file: an answer, whatever it is.
TEST(Pcap, AChangedByteIsAnAnswer) {
  for (const Form form : kForms) {
    const Bytes whole = captured(tests::made_session(2), form, 249, true).bytes;
    for (std::size_t at = 0; at < std::min<std::size_t>(whole.size(), 4000); ++at) {
      for (const std::uint8_t value : Bytes{0x00, 0xFF, 0x7F}) {
        Bytes bytes = whole;
        bytes[at] = value;
        const auto made = session_from_pcap(bytes, {});
        EXPECT_TRUE(made || made.error().code == ErrorCode::bad_data);
      }
    }
  }
}

TEST(Pcap, TheDeviceMayBeNamed) {
  const Bytes whole = captured(tests::made_session(2), Form::microseconds, 220, false).bytes;
  PcapOptions named;
  named.bus = 3;
  named.device = 9;
  EXPECT_EQ(session_from_pcap(whole, named)->transfers.size(),
            session_from_pcap(whole, {})->transfers.size());
  named.device = 5;
  EXPECT_FAILS(session_from_pcap(whole, named), ErrorCode::bad_data);
  named.device = 9;
  named.bus = 4;  // the other unit's
  const auto other = session_from_pcap(whole, named);
  ASSERT_OK(other);
  EXPECT_EQ(other->transfers.front().bytes, Bytes(64, 0x55));
}

TEST(Pcap, RefusesWhatItDoesNotReadAndSaysWhatItIs) {
  const auto why = [](const Bytes& bytes) {
    const auto made = session_from_pcap(bytes, {});
    EXPECT_FAILS(made, ErrorCode::bad_data);
    return made ? std::string() : made.error().what;
  };
  const Session session = tests::made_session(2);
  EXPECT_THAT(why({}), HasSubstr("too short"));
  EXPECT_THAT(why(Bytes(100, 0)), HasSubstr("this is no capture"));
  EXPECT_THAT(session_from_pcap(Bytes(100, 0), {}).error().hint, HasSubstr("save as pcap"))
      << "what Wireshark writes by itself is not read";
  Bytes zipped(100, 0);
  zipped[0] = 0x1F;
  zipped[1] = 0x8B;
  EXPECT_THAT(why(zipped), HasSubstr("gunzip"));
  for (const Form form : kForms) {
    EXPECT_THAT(why(Capture(form, 220, false).bytes), HasSubstr("no transfer of a unit"));
    EXPECT_THAT(why(captured(session, form, 266, false).bytes), HasSubstr("link type 266 (USB on"));
    EXPECT_THAT(why(captured(session, form, 288, false).bytes), HasSubstr("hardware analyser"));
  }
  EXPECT_THAT(why(Capture(Form::microseconds, 1, false).bytes), HasSubstr("Ethernet"));
  Bytes modified = captured(session, Form::microseconds, 220, false).bytes;
  modified[0] = 0x34;
  modified[1] = 0xCD;
  EXPECT_THAT(why(modified), HasSubstr("variant"));
  EXPECT_THAT(session_from_pcap(modified, {}).error().hint, HasSubstr("editcap -F pcap"));
  // The first block of every pcapng file (draft-ietf-opsawg-pcapng, section 4.1).
  Bytes pcapng(100, 0);
  std::copy_n(Bytes{0x0A, 0x0D, 0x0D, 0x0A}.begin(), 4, pcapng.begin());
  EXPECT_THAT(why(pcapng), HasSubstr("pcapng"));
  EXPECT_THAT(session_from_pcap(pcapng, {}).error().hint, HasSubstr("editcap -F pcap"));
}

// One packet of a capture is damaged: it is named, and no session is made of the rest.
TEST(Pcap, APacketThatContradictsItselfIsNamed) {
  const Session session = tests::made_session(2);
  constexpr std::size_t kFirstPacket = 24;
  constexpr std::size_t kFirstBody = kFirstPacket + 16;
  struct Row {
    std::uint32_t link_type;
    std::size_t at;
    Bytes bytes;
    const char* what;
  };
  const Bytes most(8, 0xFF);
  const std::vector<Row> rows = {
      {220, kFirstPacket + 8, {63, 0, 0, 0}, "shorter than its header"},
      {189, kFirstPacket + 8, {47, 0, 0, 0}, "shorter than its header"},
      {249, kFirstPacket + 8, {1, 0, 0, 0}, "shorter than its header"},
      {249, kFirstBody, {26, 0}, "shorter than its header"},
      {249, kFirstBody, {255, 255}, "shorter than its header"},
      {220, kFirstPacket + 4, {0x41, 0x42, 0x0F, 0}, "time cannot be"},    // 1 000 001 us
      {220, kFirstBody + 16, most, "time cannot be"},                      // -1 s
      {220, kFirstBody + 16, {0, 0, 0, 0, 1, 0, 0, 0}, "time cannot be"},  // 2^32 s
      {220, kFirstBody + 24, {0xFF, 0xFF, 0xFF, 0xFF}, "time cannot be"},  // -1 us
      {220, kFirstBody + 24, {0x41, 0x42, 0x0F, 0}, "time cannot be"},     // 1 000 001 us
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(std::to_string(row.link_type) + " at " + std::to_string(row.at));
    Bytes bytes = captured(session, Form::microseconds, row.link_type, false).bytes;
    ASSERT_OK(session_from_pcap(bytes, {}));
    std::copy(row.bytes.begin(), row.bytes.end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(row.at));
    const auto made = session_from_pcap(bytes, {});
    EXPECT_FAILS(made, ErrorCode::bad_data);
    EXPECT_THAT(made.error().what, HasSubstr(row.what));
    EXPECT_EQ(made.error().where, "capture, packet 1");
  }
  EXPECT_THAT(
      session_from_pcap(captured(session, Form::microseconds, 147, false).bytes, {}).error().what,
      HasSubstr("link type 147 (another bus)"));
}

// A bus or a number alone names the first unit that has it. Each bus has its own device 9.
TEST(Pcap, TheBusOrTheNumberAloneMayBeNamed) {
  const Session session = tests::made_session(2);
  const Bytes whole = captured(session, Form::microseconds, 220, false).bytes;
  PcapOptions numbered;
  numbered.device = 9;
  const auto made = session_from_pcap(whole, numbered);
  ASSERT_OK(made);
  EXPECT_EQ(made->device, "usb bus 3 device 9");
  EXPECT_EQ(made->transfers.size(), session.transfers.size()) << "the other bus has its own 9";
  PcapOptions named;
  named.bus = 3;
  EXPECT_EQ(session_from_pcap(whole, named)->device, "usb bus 3 device 9");
  named.bus = 7;
  const auto none = session_from_pcap(whole, named);
  EXPECT_FAILS(none, ErrorCode::bad_data);
  EXPECT_THAT(none.error().what, HasSubstr("no transfer of a unit"));
}

}  // namespace
}  // namespace sixpoint::device
