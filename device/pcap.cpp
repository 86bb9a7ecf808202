#include "device/pcap.h"

#include <algorithm>

#include <fmt/format.h>

#include "device/protocol.h"
#include "device/usb_ids.h"

namespace sixpoint::device {

namespace {

constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
constexpr std::uint32_t kModified = 0xA1B2CD34;  // a variant of the nineties, with longer headers
constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr std::uint32_t kByteOrder = 0x1A2B3C4D;
constexpr std::uint32_t kLinuxUsb = 189;
constexpr std::uint32_t kLinuxUsbMmapped = 220;
constexpr std::uint32_t kUsbPcap = 249;
constexpr std::size_t kFileHeader_bytes = 24;
constexpr std::size_t kPacketHeader_bytes = 16;
constexpr std::size_t kMostPackets = 2'000'000;
constexpr std::size_t kMostInterfaces = 1000;
constexpr std::uint8_t kInterrupt = 1;
constexpr std::uint8_t kBulk = 3;

using std::chrono::nanoseconds;

tl::unexpected<Error> broken(std::string what, std::size_t packet = 0) {
  return fail(ErrorCode::bad_data, std::move(what),
              packet == 0 ? "capture" : fmt::format("capture, packet {}", packet),
              "capture with 'tcpdump -i usbmonN -w capture.pcap', Wireshark or USBPcap");
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

// A packet as the file has it: whatever its link type.
struct Record {
  Order order;
  std::uint32_t link_type = 0;
  nanoseconds time{0};  // since 1970
  std::span<const std::uint8_t> body;
};

struct Packet {
  std::uint8_t event = 0;          // 'S' submitted, 'C' completed, 'E' failed
  std::uint8_t transfer_type = 0;  // 1 interrupt, 3 bulk
  std::uint8_t endpoint = 0;
  std::uint16_t device = 0;
  std::uint16_t bus = 0;
  nanoseconds time{0};
  std::span<const std::uint8_t> data;
};

std::string words_for(std::uint32_t link_type) {
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

Status check_link_type(std::uint32_t link_type) {
  if (link_type != kLinuxUsb && link_type != kLinuxUsbMmapped && link_type != kUsbPcap) {
    return broken(
        fmt::format("this capture is of link type {} ({}); 189 and 220 (USB on Linux) "
                    "and 249 (USBPcap) are read",
                    link_type, words_for(link_type)));
  }
  return {};
}

// Classic pcap: one link type, one clock.
class PcapFile {
 public:
  static Result<PcapFile> open(std::span<const std::uint8_t> bytes) {
    if (bytes.size() < kFileHeader_bytes) {
      return broken("this is no capture: it is too short");
    }
    PcapFile file;
    file.bytes_ = bytes;
    std::uint32_t magic = file.order_.get<std::uint32_t>(bytes, 0);
    if (!known(magic)) {
      file.order_.big = true;
      magic = file.order_.get<std::uint32_t>(bytes, 0);
    }
    if (magic == kModified) {
      return broken(
          "this capture is of a variant of pcap that is not read; convert it with "
          "'editcap -F pcap'");
    }
    if (!known(magic)) {
      return bytes[0] == 0x1F && bytes[1] == 0x8B
                 ? broken("this capture is compressed; unpack it with gunzip")
                 : broken("this is no capture, neither pcap nor pcapng");
    }
    file.tick_ = nanoseconds(magic == kNanoseconds ? 1 : 1000);
    file.ticks_ = magic == kNanoseconds ? 1'000'000'000 : 1'000'000;
    file.link_type_ = file.order_.get<std::uint32_t>(bytes, 20) & 0x0FFFFFFFU;
    SIXPOINT_CHECK(check_link_type(file.link_type_));
    return file;
  }

  // Empty at the end, and where the last packet is cut off: a capture that was stopped hard.
  Result<std::optional<Record>> next() {
    if (at_ == bytes_.size()) {
      return std::nullopt;
    }
    ++number_;
    if (bytes_.size() - at_ < kPacketHeader_bytes) {
      return broken("the capture ends within a packet's header", number_);
    }
    Record record;
    record.order = order_;
    record.link_type = link_type_;
    const auto ticks = order_.get<std::uint32_t>(bytes_, at_ + 4);
    if (ticks > ticks_) {
      return broken("a packet's time cannot be", number_);
    }
    record.time = std::chrono::seconds(order_.get<std::uint32_t>(bytes_, at_)) + ticks * tick_;
    const auto captured = order_.get<std::uint32_t>(bytes_, at_ + 8);
    at_ += kPacketHeader_bytes;
    if (captured > bytes_.size() - at_) {
      return std::nullopt;
    }
    record.body = bytes_.subspan(at_, captured);
    at_ += captured;
    return record;
  }

 private:
  static bool known(std::uint32_t magic) {
    return magic == kMicroseconds || magic == kNanoseconds || magic == kModified;
  }
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = kFileHeader_bytes;
  std::size_t number_ = 0;
  Order order_;
  nanoseconds tick_{1000};
  std::uint32_t ticks_ = 0;  // in a second
  std::uint32_t link_type_ = 0;
};

// pcapng: sections of either order, interfaces with a link type and a clock each.
class PcapngFile {
 public:
  explicit PcapngFile(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  static bool is_one(std::span<const std::uint8_t> bytes) {
    // The same in either order.
    return bytes.size() >= 4 && Order{}.get<std::uint32_t>(bytes, 0) == kSectionHeader;
  }

  Result<std::optional<Record>> next() {
    constexpr std::size_t kSmallestBlock_bytes = 12;
    while (at_ < bytes_.size()) {
      ++number_;
      const auto rest = bytes_.subspan(at_);
      if (rest.size() < kSmallestBlock_bytes) {
        return end();  // stopped hard
      }
      const auto type = order_.get<std::uint32_t>(rest, 0);
      if (type == kSectionHeader) {
        SIXPOINT_CHECK(begin_section(rest));
      } else if (number_ == 1) {
        return broken("this is no capture of the pcapng form");
      }
      const auto length = order_.get<std::uint32_t>(rest, 4);
      if (length < kSmallestBlock_bytes || length % 4 != 0) {
        return broken("a block's length cannot be", number_);
      }
      if (length > rest.size()) {
        return end();
      }
      if (order_.get<std::uint32_t>(rest, length - 4) != length) {
        return broken("a block's two lengths differ", number_);
      }
      const auto body = rest.subspan(8, length - kSmallestBlock_bytes);
      at_ += length;
      constexpr std::uint32_t kInterface = 1;
      constexpr std::uint32_t kOldPacket = 2;
      constexpr std::uint32_t kSimplePacket = 3;
      constexpr std::uint32_t kEnhancedPacket = 6;
      if (type == kInterface) {
        SIXPOINT_CHECK(add_interface(body));
      } else if (type == kEnhancedPacket) {
        SIXPOINT_ASSIGN(auto record, packet(body));
        if (record) {
          any_ = true;
          return record;
        }
      } else if (type == kSimplePacket || type == kOldPacket) {
        return broken(
            "a packet without its own time (a simple or an obsolete packet block): "
            "convert the capture with 'editcap -F pcap'",
            number_);
      }
    }
    return end();
  }

 private:
  // Other interfaces of the machine may stand in the same file; where none is of USB, that is said.
  Result<std::optional<Record>> end() const {
    if (!any_ && other_) {
      return fail(*other_);
    }
    return std::nullopt;
  }

  struct Interface {
    std::uint32_t link_type = 0;
    std::uint8_t resolution = 6;  // if_tsresol
    std::int64_t offset_s = 0;    // if_tsoffset
  };

  Status begin_section(std::span<const std::uint8_t> block) {
    constexpr std::size_t kSection_bytes = 28;
    if (block.size() < kSection_bytes) {
      return broken("the capture ends within its header", number_);
    }
    order_.big = Order{}.get<std::uint32_t>(block, 8) != kByteOrder;
    if (order_.get<std::uint32_t>(block, 8) != kByteOrder) {
      return broken("a section of no known byte order", number_);
    }
    if (order_.get<std::uint16_t>(block, 12) != 1) {
      return broken(
          fmt::format("version {} of pcapng is not read", order_.get<std::uint16_t>(block, 12)),
          number_);
    }
    interfaces_.clear();
    return {};
  }

  Status add_interface(std::span<const std::uint8_t> body) {
    constexpr std::size_t kInterface_bytes = 8;
    if (body.size() < kInterface_bytes || interfaces_.size() >= kMostInterfaces) {
      return broken("a description of an interface that cannot be", number_);
    }
    Interface made;
    made.link_type = order_.get<std::uint16_t>(body, 0);
    auto options = body.subspan(kInterface_bytes);
    while (options.size() >= 4) {
      const auto code = order_.get<std::uint16_t>(options, 0);
      const std::size_t length = order_.get<std::uint16_t>(options, 2);
      const std::size_t padded = (length + 3) / 4 * 4;
      constexpr std::uint16_t kEnd = 0;
      constexpr std::uint16_t kResolution = 9;
      constexpr std::uint16_t kOffset = 14;
      if (code == kEnd || padded > options.size() - 4) {
        break;
      }
      if (code == kResolution && length >= 1) {
        made.resolution = options[4];
      } else if (code == kOffset && length >= 8) {
        made.offset_s = order_.get<std::int64_t>(options, 4);
      }
      options = options.subspan(4 + padded);
    }
    interfaces_.push_back(made);
    return {};
  }

  // Empty for one of an interface that is not of USB.
  Result<std::optional<Record>> packet(std::span<const std::uint8_t> body) {
    constexpr std::size_t kPacket_bytes = 20;
    if (body.size() < kPacket_bytes) {
      return broken("a packet is shorter than its header", number_);
    }
    const auto index = order_.get<std::uint32_t>(body, 0);
    const auto captured = order_.get<std::uint32_t>(body, 12);
    if (index >= interfaces_.size() || captured > body.size() - kPacket_bytes) {
      return broken("a packet of no interface, or longer than its block", number_);
    }
    const Interface& interface = interfaces_[index];
    if (const Status known = check_link_type(interface.link_type); !known) {
      other_ = known.error();
      return std::nullopt;
    }
    const std::uint64_t ticks = (std::uint64_t{order_.get<std::uint32_t>(body, 4)} << 32U) |
                                order_.get<std::uint32_t>(body, 8);
    SIXPOINT_ASSIGN(const nanoseconds time, time_of(ticks, interface));
    Record record;
    record.order = order_;
    record.link_type = interface.link_type;
    record.time = time;
    record.body = body.subspan(kPacket_bytes, captured);
    return record;
  }

  // Resolutions of ten to the minus 0 to 9, or two to the minus 0 to 32, of a second.
  Result<nanoseconds> time_of(std::uint64_t ticks, const Interface& interface) const {
    const unsigned exponent = interface.resolution & 0x7FU;
    const bool binary = (interface.resolution & 0x80U) != 0;
    if (exponent > (binary ? 32U : 9U)) {
      return broken("a clock of a resolution that is not read", number_);
    }
    std::uint64_t per_second = 1;
    for (unsigned i = 0; i < exponent; ++i) {
      per_second *= binary ? 2 : 10;
    }
    constexpr std::int64_t kLatest_s = 4'294'967'295;  // 2106
    const std::uint64_t whole = ticks / per_second;
    if (whole > static_cast<std::uint64_t>(kLatest_s) || interface.offset_s < -kLatest_s ||
        interface.offset_s > kLatest_s) {
      return broken("a packet's time cannot be", number_);
    }
    const std::int64_t whole_s = static_cast<std::int64_t>(whole) + interface.offset_s;
    if (whole_s < 0 || whole_s > kLatest_s) {
      return broken("a packet's time cannot be", number_);
    }
    const std::uint64_t rest_ns = ticks % per_second * 1'000'000'000 / per_second;
    return std::chrono::seconds(whole_s) + nanoseconds(rest_ns);
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::size_t number_ = 0;
  Order order_;
  std::vector<Interface> interfaces_;
  bool any_ = false;
  std::optional<Error> other_;
};

// usbmon's header (Documentation/usb/usbmon.rst), of 48 or 64 bytes, in the order of the file.
Result<Packet> parse_usbmon(const Record& record, std::size_t number) {
  const std::size_t header_bytes = record.link_type == kLinuxUsb ? 48 : 64;
  const auto body = record.body;
  if (body.size() < header_bytes) {
    return broken("a packet is shorter than its header", number);
  }
  Packet packet;
  packet.event = body[8];
  packet.transfer_type = body[9];
  packet.endpoint = body[10];
  packet.device = body[11];
  packet.bus = record.order.get<std::uint16_t>(body, 12);
  const auto whole_s = record.order.get<std::int64_t>(body, 16);
  const auto rest_us = record.order.get<std::int32_t>(body, 24);
  constexpr std::int64_t kLatest_s = 4'294'967'295;
  if (whole_s < 0 || whole_s > kLatest_s || rest_us < 0 || rest_us > 1'000'000) {
    return broken("a packet's time cannot be", number);
  }
  packet.time = std::chrono::seconds(whole_s) + std::chrono::microseconds(rest_us);
  const auto length = record.order.get<std::uint32_t>(body, 36);
  const auto data = body.subspan(header_bytes);
  packet.data = data.first(std::min<std::size_t>(length, data.size()));
  return packet;
}

// USBPcap's header (desowin.org/usbpcap/captureformat.html): little-endian whatever the file, and
// its length is said. What goes down is there when it is submitted, what comes up when it is done.
Result<Packet> parse_usbpcap(const Record& record, std::size_t number) {
  constexpr std::size_t kHeader_bytes = 27;
  const Order little;
  const auto body = record.body;
  const std::size_t header_bytes = body.size() < 2 ? 0 : little.get<std::uint16_t>(body, 0);
  if (header_bytes < kHeader_bytes || header_bytes > body.size()) {
    return broken("a packet is shorter than its header", number);
  }
  Packet packet;
  const bool up = (body[16] & 1U) != 0;
  packet.event = static_cast<std::uint8_t>(up ? 'C' : 'S');
  packet.bus = little.get<std::uint16_t>(body, 17);
  packet.device = little.get<std::uint16_t>(body, 19);
  packet.endpoint = body[21];
  packet.transfer_type = body[22];
  packet.time = record.time;
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

// Keeps the transfers of one device: the one that is named, or the first one that speaks.
class Collector {
 public:
  explicit Collector(const PcapOptions& options) : bus_(options.bus), device_(options.device) {}

  void take(const Packet& packet) {
    if (!device_ && is_report(packet.data) && (!bus_ || packet.bus == *bus_)) {
      bus_ = packet.bus;
      device_ = packet.device;
      for (const Packet& earlier : before_) {
        keep(earlier);
      }
      before_.clear();
    }
    constexpr std::size_t kMostBefore = 100'000;
    if (device_) {
      keep(packet);
    } else if (before_.size() < kMostBefore) {
      before_.push_back(packet);
    }
  }

  Result<Session> finish() {
    if (session_.transfers.empty()) {
      return broken(
          "the capture holds no transfer of a unit; name it with --bus and --device-number");
    }
    session_.device = fmt::format("usb bus {} device {}", bus_.value_or(0), device_.value_or(0));
    session_.started = UtcTime(*start_);
    return std::move(session_);
  }

 private:
  void keep(const Packet& packet) {
    if ((bus_ && packet.bus != *bus_) || packet.device != *device_) {
      return;
    }
    auto transfer = transfer_of(packet);
    if (!transfer) {
      return;
    }
    start_ = start_.value_or(packet.time);
    // Completions of several processors may stand a little out of order.
    transfer->time =
        std::max(packet.time - *start_,
                 session_.transfers.empty() ? nanoseconds::zero() : session_.transfers.back().time);
    session_.transfers.push_back(std::move(*transfer));
  }

  std::optional<std::uint16_t> bus_;
  std::optional<std::uint16_t> device_;
  std::vector<Packet> before_;  // of every device, until one is chosen
  std::optional<nanoseconds> start_;
  Session session_;
};

template <class File>
Result<Session> collect(File file, const PcapOptions& options) {
  Collector collector(options);
  for (std::size_t number = 1;; ++number) {
    if (number > kMostPackets) {
      return broken("the capture has more packets than a session is made of", number);
    }
    SIXPOINT_ASSIGN(const auto record, file.next());
    if (!record) {
      return collector.finish();
    }
    SIXPOINT_ASSIGN(const Packet packet, record->link_type == kUsbPcap
                                             ? parse_usbpcap(*record, number)
                                             : parse_usbmon(*record, number));
    collector.take(packet);
  }
}

}  // namespace

Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options) {
  if (PcapngFile::is_one(bytes)) {
    return collect(PcapngFile(bytes), options);
  }
  SIXPOINT_ASSIGN(const PcapFile file, PcapFile::open(bytes));
  return collect(file, options);
}

}  // namespace sixpoint::device
