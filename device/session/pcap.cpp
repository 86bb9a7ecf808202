#include "device/session/pcap.h"

#include <algorithm>

#include <fmt/format.h>

#include "device/usb/usb_ids.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

namespace {

constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
constexpr std::uint32_t kModified = 0xA1B2CD34;  // an old variant with longer headers
constexpr std::uint32_t kPcapng = 0x0A0D0D0A;    // the same in both byte orders
constexpr std::uint32_t kLinuxUsb = 189;
constexpr std::uint32_t kLinuxUsbMmapped = 220;
constexpr std::uint32_t kUsbPcap = 249;
constexpr std::size_t kFileHeader_bytes = 24;
constexpr std::size_t kPacketHeader_bytes = 16;
constexpr std::size_t kMostPackets = 2'000'000;
constexpr std::uint8_t kInterrupt = 1;
constexpr std::uint8_t kBulk = 3;

using std::chrono::nanoseconds;

tl::unexpected<Error> broken_capture(std::string what, std::size_t packet = 0) {
  return fail(
      ErrorCode::bad_data, std::move(what),
      packet == 0 ? "capture" : fmt::format("capture, packet {}", packet),
      "capture with 'tcpdump -i usbmonN -w capture.pcap', USBPcap, or Wireshark (save as pcap)");
}

// Integers in the byte order of the machine that captured.
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
  std::uint8_t event = 0;  // 'S' submitted, 'C' completed, 'E' failed
  std::uint8_t transfer_type = 0;
  std::uint8_t endpoint = 0;
  std::uint16_t device = 0;
  std::uint16_t bus = 0;
  nanoseconds time{0};  // since 1970
  std::span<const std::uint8_t> data;
};

std::string link_name(std::uint32_t link_type) {
  switch (link_type) {
    case 266:
      return "USB on macOS";
    case 186:
    case 288:
    case 293:
    case 294:
    case 295:
      return "packets of the bus itself, of a hardware analyser";
    case 1:
      return "Ethernet";
    default:
      return "another bus";
  }
}

// The file header: byte order, unit of time, link type.
struct FileHeader {
  Order order;
  bool nanosecond_times = false;
  std::uint32_t link_type = 0;
};

Result<FileHeader> parse_file_header(std::span<const std::uint8_t> bytes) {
  const auto convert = [](const char* what) {
    return fail(ErrorCode::bad_data, what, "capture",
                "convert it with 'editcap -F pcap OLD NEW' (a tool of Wireshark)");
  };
  if (bytes.size() < kFileHeader_bytes) {
    return broken_capture("this is no capture: it is too short");
  }
  FileHeader header;
  for (const bool big : {false, true}) {
    header.order.big = big;
    const auto magic = header.order.get<std::uint32_t>(bytes, 0);
    if (magic == kModified) {
      return convert("this capture is of a variant of pcap that is not read");
    }
    if (magic == kPcapng) {
      return convert("this capture has the form pcapng; the form pcap is read");
    }
    header.nanosecond_times = magic == kNanoseconds;
    if (header.nanosecond_times || magic == kMicroseconds) {
      header.link_type = header.order.get<std::uint32_t>(bytes, 20) & 0x0FFFFFFFU;
      if (header.link_type == kLinuxUsb || header.link_type == kLinuxUsbMmapped ||
          header.link_type == kUsbPcap) {
        return header;
      }
      return broken_capture(
          fmt::format("this capture is of link type {} ({}); 189 and 220 (USB on Linux) "
                      "and 249 (USBPcap) are read",
                      header.link_type, link_name(header.link_type)));
    }
  }
  return bytes[0] == 0x1F && bytes[1] == 0x8B
             ? broken_capture("this capture is compressed; unpack it with gunzip")
             : broken_capture("this is no capture of the form pcap");
}

// usbmon's header (Documentation/usb/usbmon.rst), of 48 or 64 bytes, in the order of the file.
Result<Packet> parse_usbmon(const FileHeader& file, std::span<const std::uint8_t> body,
                            std::size_t number) {
  const Order order = file.order;
  const std::size_t header_bytes = file.link_type == kLinuxUsb ? 48 : 64;
  if (body.size() < header_bytes) {
    return broken_capture("a packet is shorter than its header", number);
  }
  Packet packet;
  packet.event = body[8];
  packet.transfer_type = body[9];
  packet.endpoint = body[10];
  packet.device = body[11];
  packet.bus = order.get<std::uint16_t>(body, 12);
  const auto whole_s = order.get<std::int64_t>(body, 16);
  const auto rest_us = order.get<std::int32_t>(body, 24);
  constexpr std::int64_t kLatest_s = 4'294'967'295;
  if (whole_s < 0 || whole_s > kLatest_s || rest_us < 0 || rest_us > 1'000'000) {
    return broken_capture("a packet's time cannot be", number);
  }
  packet.time = std::chrono::seconds(whole_s) + std::chrono::microseconds(rest_us);
  const auto length = order.get<std::uint32_t>(body, 36);
  const auto data = body.subspan(header_bytes);
  packet.data = data.first(std::min<std::size_t>(length, data.size()));
  return packet;
}

// USBPcap's header (desowin.org/usbpcap/captureformat.html) is always little-endian and gives its
// own length. Output data stand in the submission, input data in the completion.
Result<Packet> parse_usbpcap(std::span<const std::uint8_t> body, nanoseconds time,
                             std::size_t number) {
  constexpr std::size_t kHeader_bytes = 27;
  const Order little;
  const std::size_t header_bytes = body.size() < 2 ? 0 : little.get<std::uint16_t>(body, 0);
  if (header_bytes < kHeader_bytes || header_bytes > body.size()) {
    return broken_capture("a packet is shorter than its header", number);
  }
  Packet packet;
  const bool up = (body[16] & 1U) != 0;
  packet.event = static_cast<std::uint8_t>(up ? 'C' : 'S');
  packet.bus = little.get<std::uint16_t>(body, 17);
  packet.device = little.get<std::uint16_t>(body, 19);
  packet.endpoint = body[21];
  packet.transfer_type = body[22];
  packet.time = time;
  const auto length = little.get<std::uint32_t>(body, 23);
  const auto data = body.subspan(header_bytes);
  packet.data = data.first(std::min<std::size_t>(length, data.size()));
  return packet;
}

bool is_report(std::span<const std::uint8_t> bytes) {
  return bytes.size() == kReportBytes && decode(bytes).has_value();
}

std::optional<SessionTransfer> transfer_of(const Packet& packet) {
  SessionTransfer transfer;
  const bool in = (packet.endpoint & 0x80U) != 0;
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

// Collects the transfers of one device: the named one, or where its bus or its number is not named,
// the first that fits and sends or gets a report.
class Collector {
 public:
  explicit Collector(const PcapOptions& options) : bus_(options.bus), device_(options.device) {}

  void take(const Packet& packet) {
    if (!is_chosen() && may_be_it(packet) && is_report(packet.data)) {
      bus_ = packet.bus;
      device_ = packet.device;
      for (const Packet& earlier : before_) {
        keep(earlier);
      }
      before_.clear();
    }
    constexpr std::size_t kMostBefore = 100'000;
    if (is_chosen()) {
      keep(packet);
    } else if (before_.size() < kMostBefore) {
      before_.push_back(packet);
    }
  }

  Result<Session> finish() {
    if (session_.transfers.empty()) {
      return broken_capture(
          "the capture holds no transfer of a unit; name it with --bus and --device-number");
    }
    session_.device = fmt::format("usb bus {} device {}", *bus_, *device_);
    session_.started = UtcTime(*start_);
    return std::move(session_);
  }

 private:
  // A device has its number on its bus alone.
  bool is_chosen() const { return bus_ && device_; }
  bool may_be_it(const Packet& packet) const {
    return packet.bus == bus_.value_or(packet.bus) &&
           packet.device == device_.value_or(packet.device);
  }

  void keep(const Packet& packet) {
    if (!may_be_it(packet)) {
      return;
    }
    auto transfer = transfer_of(packet);
    if (!transfer) {
      return;
    }
    start_ = start_.value_or(packet.time);
    // Completions of several processors may stand a little out of order.
    transfer->time = std::clamp(
        packet.time - *start_,
        session_.transfers.empty() ? nanoseconds::zero() : session_.transfers.back().time,
        kLongestSession);
    session_.transfers.push_back(std::move(*transfer));
  }

  std::optional<std::uint16_t> bus_;
  std::optional<std::uint16_t> device_;
  std::vector<Packet> before_;  // of every device, until one is chosen
  std::optional<nanoseconds> start_;
  Session session_;
};

}  // namespace

Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options) {
  SIXPOINT_ASSIGN(const FileHeader file, parse_file_header(bytes));
  const Order order = file.order;
  Collector collector(options);
  bytes = bytes.subspan(kFileHeader_bytes);
  for (std::size_t number = 1; !bytes.empty(); ++number) {
    if (number > kMostPackets) {
      return broken_capture("the capture has more packets than a session is made of", number);
    }
    if (bytes.size() < kPacketHeader_bytes) {
      return broken_capture("the capture ends within a packet's header", number);
    }
    const auto ticks = order.get<std::uint32_t>(bytes, 4);
    if (ticks > (file.nanosecond_times ? 1'000'000'000U : 1'000'000U)) {
      return broken_capture("a packet's time cannot be", number);
    }
    const nanoseconds time = std::chrono::seconds(order.get<std::uint32_t>(bytes, 0)) +
                             nanoseconds(file.nanosecond_times ? 1 : 1000) * ticks;
    const auto captured = order.get<std::uint32_t>(bytes, 8);
    bytes = bytes.subspan(kPacketHeader_bytes);
    if (captured > bytes.size()) {
      break;  // the capture was stopped within its last packet
    }
    const auto body = bytes.first(captured);
    bytes = bytes.subspan(captured);
    SIXPOINT_ASSIGN(const Packet packet, file.link_type == kUsbPcap
                                             ? parse_usbpcap(body, time, number)
                                             : parse_usbmon(file, body, number));
    collector.take(packet);
  }
  return collector.finish();
}

}  // namespace sixpoint::device
