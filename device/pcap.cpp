#include "device/pcap.h"

#include <algorithm>

#include <fmt/format.h>

#include "device/protocol.h"
#include "device/usb_ids.h"

namespace sixpoint::device {

namespace {

constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
constexpr std::uint32_t kLinuxUsb = 189;
constexpr std::uint32_t kLinuxUsbMmapped = 220;
constexpr std::size_t kFileHeader_bytes = 24;
constexpr std::size_t kPacketHeader_bytes = 16;
constexpr std::size_t kMostPackets = 2'000'000;

tl::unexpected<Error> broken(std::string what, std::size_t packet = 0) {
  return fail(ErrorCode::bad_data, std::move(what),
              packet == 0 ? "capture" : fmt::format("capture, packet {}", packet),
              "capture with: tcpdump -i usbmonN -w capture.pcap");
}

// Integers in the order of the machine that captured.
struct Order {
  bool big = false;

  template <class Integer>
  Integer get(std::span<const std::uint8_t> bytes, std::size_t at) const {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(Integer); ++i) {
      const std::size_t from = big ? i : sizeof(Integer) - 1 - i;
      value = (value << 8U) | bytes[at + from];
    }
    return static_cast<Integer>(value);
  }
};

struct Packet {
  std::uint8_t event = 0;          // 'S' submitted, 'C' completed, 'E' failed
  std::uint8_t transfer_type = 0;  // 1 interrupt, 3 bulk
  std::uint8_t endpoint = 0;
  std::uint8_t device = 0;
  std::uint16_t bus = 0;
  std::int32_t status = 0;
  std::chrono::nanoseconds time{0};
  std::span<const std::uint8_t> data;
};

bool is_report(std::span<const std::uint8_t> bytes) {
  return bytes.size() == kReportBytes && decode(bytes).has_value();
}

std::optional<SessionTransfer> transfer_of(const Packet& packet) {
  SessionTransfer transfer;
  const bool in = (packet.endpoint & 0x80U) != 0;
  constexpr std::uint8_t kInterrupt = 1;
  constexpr std::uint8_t kBulk = 3;
  if (packet.transfer_type == kInterrupt) {
    transfer.channel = SessionChannel::reports;
  } else if (packet.transfer_type == kBulk &&
             (packet.endpoint == kBulkInEndpoint || packet.endpoint == kBulkOutEndpoint)) {
    transfer.channel = SessionChannel::bulk;
  } else {
    return std::nullopt;
  }
  if (packet.data.empty() || (in ? packet.event != 'C' : packet.event != 'S')) {
    return std::nullopt;
  }
  transfer.kind = in ? SessionTransfer::Kind::from_device : SessionTransfer::Kind::to_device;
  transfer.bytes.assign(packet.data.begin(), packet.data.end());
  return transfer;
}

}  // namespace

Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options) {
  if (bytes.size() < kFileHeader_bytes) {
    return broken("this is no capture: it is too short");
  }
  Order order;
  std::uint32_t magic = order.get<std::uint32_t>(bytes, 0);
  if (magic != kMicroseconds && magic != kNanoseconds) {
    order.big = true;
    magic = order.get<std::uint32_t>(bytes, 0);
  }
  if (magic != kMicroseconds && magic != kNanoseconds) {
    return broken("this is no capture of the pcap form (pcapng: convert it with editcap -F pcap)");
  }
  const auto link_type = order.get<std::uint32_t>(bytes, 20) & 0x0FFFFFFFU;
  if (link_type != kLinuxUsb && link_type != kLinuxUsbMmapped) {
    return broken(fmt::format("this capture is of link type {}, not of USB on Linux", link_type));
  }
  const std::size_t usb_header_bytes = link_type == kLinuxUsb ? 48 : 64;

  Session session;
  std::optional<std::uint16_t> bus = options.bus;
  std::optional<std::uint8_t> device = options.device;
  std::optional<std::chrono::nanoseconds> start;
  std::vector<Packet> before;  // of every device, until one is chosen
  constexpr std::size_t kMostBefore = 100'000;
  const auto keep = [&](const Packet& packet) {
    if ((bus && packet.bus != *bus) || (device && packet.device != *device)) {
      return;
    }
    auto transfer = transfer_of(packet);
    if (!transfer) {
      return;
    }
    start = start.value_or(packet.time);
    transfer->time =
        std::max(packet.time - *start, session.transfers.empty() ? std::chrono::nanoseconds::zero()
                                                                 : session.transfers.back().time);
    session.transfers.push_back(std::move(*transfer));
  };

  std::size_t number = 0;
  for (std::size_t at = kFileHeader_bytes; at < bytes.size();) {
    if (++number > kMostPackets) {
      return broken("the capture has more packets than a session is made of", number);
    }
    if (bytes.size() - at < kPacketHeader_bytes) {
      return broken("the capture ends within a packet's header", number);
    }
    const auto captured = order.get<std::uint32_t>(bytes, at + 8);
    at += kPacketHeader_bytes;
    if (captured > bytes.size() - at) {
      break;  // the last packet of a capture that was stopped hard
    }
    const auto body = bytes.subspan(at, captured);
    at += captured;
    if (body.size() < usb_header_bytes) {
      return broken("a packet is shorter than its header", number);
    }
    Packet packet;
    packet.event = body[8];
    packet.transfer_type = body[9];
    packet.endpoint = body[10];
    packet.device = body[11];
    packet.bus = order.get<std::uint16_t>(body, 12);
    const auto whole_s = order.get<std::int64_t>(body, 16);
    const auto rest_us = order.get<std::int32_t>(body, 24);
    constexpr std::int64_t kLatest_s = 4'294'967'295;  // 2106
    if (whole_s < 0 || whole_s > kLatest_s || rest_us < 0 || rest_us > 1'000'000) {
      return broken("a packet's time cannot be", number);
    }
    packet.time = std::chrono::seconds(whole_s) + std::chrono::microseconds(rest_us);
    packet.status = order.get<std::int32_t>(body, 28);
    const auto length = order.get<std::uint32_t>(body, 36);
    const auto data = body.subspan(usb_header_bytes);
    packet.data = data.first(std::min<std::size_t>(length, data.size()));

    if (!device && is_report(packet.data) && (!bus || packet.bus == *bus)) {
      bus = packet.bus;
      device = packet.device;
      for (const Packet& earlier : before) {
        keep(earlier);
      }
      before.clear();
    }
    if (device) {
      keep(packet);
    } else if (before.size() < kMostBefore) {
      before.push_back(packet);
    }
  }
  if (session.transfers.empty()) {
    return broken(
        "the capture holds no transfer of a unit; name it with --bus and --device-number");
  }
  session.device = fmt::format("usb bus {} device {}", bus.value_or(0), device.value_or(0));
  session.started = UtcTime(*start);
  return session;
}

}  // namespace sixpoint::device
