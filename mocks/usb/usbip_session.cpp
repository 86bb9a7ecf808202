#include "mocks/usb/usbip_session.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace sixpoint::mocks {

namespace {

constexpr std::uint16_t kVersion = 0x0111;
constexpr std::uint16_t kRequestDeviceList = 0x8005;
constexpr std::uint16_t kReplyDeviceList = 0x0005;
constexpr std::uint16_t kRequestImport = 0x8003;
constexpr std::uint16_t kReplyImport = 0x0003;
constexpr std::size_t kOperationBytes = 8;
constexpr std::size_t kPathBytes = 256;
constexpr std::size_t kBusIdBytes = 32;

// usbip_common.h: ST_NA is never ours.
constexpr std::uint32_t kOk = 0;
constexpr std::uint32_t kBusy = 2;
constexpr std::uint32_t kNoDevice = 4;

constexpr std::uint32_t kSubmit = 1;
constexpr std::uint32_t kUnlink = 2;
constexpr std::uint32_t kReplySubmit = 3;
constexpr std::uint32_t kReplyUnlink = 4;
constexpr std::size_t kCommandBytes = 48;
constexpr std::uint32_t kNotIsochronous = 0xFFFFFFFF;
constexpr std::uint32_t kShortNotOk = 0x0001;  // URB_SHORT_NOT_OK

// Linux' error numbers, which are the protocol's, whatever machine this runs on.
constexpr std::int32_t kNoSuchDevice = -19;  // ENODEV
constexpr std::int32_t kStalled = -32;       // EPIPE
constexpr std::int32_t kOverflow = -75;      // EOVERFLOW
constexpr std::int32_t kUnlinked = -104;     // ECONNRESET
constexpr std::int32_t kGone = -108;         // ESHUTDOWN
constexpr std::int32_t kShort = -121;        // EREMOTEIO

constexpr SetupPacket kConfigure = {0x00, 9, 1, 0, 0};
// What Linux' stub takes for a port reset: SET_FEATURE(PORT_RESET) as to a hub.
constexpr std::uint8_t kHubPortRequest = 0x23;
constexpr std::uint8_t kSetFeature = 3;
constexpr std::uint16_t kPortReset = 4;

std::uint32_t big32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (static_cast<std::uint32_t>(bytes[at]) << 24U) |
         (static_cast<std::uint32_t>(bytes[at + 1]) << 16U) |
         (static_cast<std::uint32_t>(bytes[at + 2]) << 8U) | bytes[at + 3];
}

std::uint16_t big16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>((bytes[at] << 8U) | bytes[at + 1]);
}

void put16(Bytes& out, std::uint16_t value) {
  out.push_back(static_cast<std::uint8_t>(value >> 8U));
  out.push_back(static_cast<std::uint8_t>(value & 0xFFU));
}

void put32(Bytes& out, std::uint32_t value) {
  put16(out, static_cast<std::uint16_t>(value >> 16U));
  put16(out, static_cast<std::uint16_t>(value & 0xFFFFU));
}

void put_text(Bytes& out, std::string_view text, std::size_t width) {
  const std::size_t end = out.size() + width;
  text = text.substr(0, width - 1);
  out.insert(out.end(), text.begin(), text.end());
  out.resize(end, 0);
}

void put_operation(Bytes& out, std::uint16_t code, std::uint32_t status) {
  put16(out, kVersion);
  put16(out, code);
  put32(out, status);
}

}  // namespace

UsbipBus::UsbipBus(std::vector<std::shared_ptr<UsbDevice>> devices) {
  std::uint32_t number = 0;
  for (auto& device : devices) {
    ++number;
    // Device 1 of a bus is its root hub.
    ports_.push_back({fmt::format("1-{}", number), 1, number + 1, std::move(device), false});
  }
}

UsbipBus::Port* UsbipBus::find(std::string_view busid) {
  const auto found = std::find_if(ports_.begin(), ports_.end(),
                                  [busid](const Port& port) { return port.busid == busid; });
  return found == ports_.end() ? nullptr : &*found;
}

UsbipSession::UsbipSession(UsbipBus& bus, UsbipLimits limits) : bus_(bus), limits_(limits) {}

UsbipSession::~UsbipSession() { end(); }

void UsbipSession::end() {
  over_ = true;
  waiting_.clear();
  requests_ = 0;
  request_bytes_ = 0;
  if (port_ != nullptr) {
    port_->device->bus_reset();
    port_->in_use = false;
    port_ = nullptr;
  }
}

bool UsbipSession::wants_input() const {
  return !over_ && output().size() + request_bytes_ < limits_.waiting_bytes;
}

void UsbipSession::sent(std::size_t count) {
  output_taken_ += count;
  if (output_taken_ == output_.size()) {
    output_.clear();
    output_taken_ = 0;
  } else if (output_taken_ > (1U << 20U)) {
    output_.erase(output_.begin(), output_.begin() + static_cast<std::ptrdiff_t>(output_taken_));
    output_taken_ = 0;
  }
}

void UsbipSession::receive(std::span<const std::uint8_t> bytes) {
  if (over_) {
    return;
  }
  input_.insert(input_.end(), bytes.begin(), bytes.end());
  std::span<const std::uint8_t> rest = input_;
  while (!over_ && (port_ == nullptr ? take_operation(rest) : take_command(rest))) {
  }
  if (over_) {
    input_.clear();
    return;
  }
  input_.erase(input_.begin(), input_.end() - static_cast<std::ptrdiff_t>(rest.size()));
  pump();
}

bool UsbipSession::take_operation(std::span<const std::uint8_t>& bytes) {
  if (bytes.size() < kOperationBytes) {
    return false;
  }
  if (big16(bytes, 0) != kVersion) {
    end();
    return false;
  }
  switch (big16(bytes, 2)) {
    case kRequestDeviceList:
      bytes = bytes.subspan(kOperationBytes);
      list_devices();
      end();  // as Linux' server: one list, and the connection is closed
      return false;
    case kRequestImport: {
      if (bytes.size() < kOperationBytes + kBusIdBytes) {
        return false;
      }
      const auto field = bytes.subspan(kOperationBytes, kBusIdBytes);
      const auto text_end = std::find(field.begin(), field.end(), 0);
      const std::string busid(field.begin(), text_end);
      bytes = bytes.subspan(kOperationBytes + kBusIdBytes);
      import(busid);
      return true;
    }
    default:
      end();
      return false;
  }
}

void UsbipSession::put_device(const UsbipBus::Port& port) {
  const UsbDescriptors& usb = port.device->descriptors();
  put_text(output_, fmt::format("/sys/devices/platform/sixpoint/usb1/{}", port.busid), kPathBytes);
  put_text(output_, port.busid, kBusIdBytes);
  put32(output_, port.bus_number);
  put32(output_, port.device_number);
  put32(output_, static_cast<std::uint32_t>(usb.speed));
  put16(output_, usb.vendor_id());
  put16(output_, usb.product_id());
  const Bytes& device = usb.device;
  put16(output_, static_cast<std::uint16_t>(device[12] | (device[13] << 8U)));
  output_.insert(output_.end(), {device[4], device[5], device[6]});
  // The number of the configuration that the exporting host has set (import() does).
  output_.push_back(usb.configuration[5]);
  output_.push_back(device[17]);
  output_.push_back(usb.configuration[4]);
}

void UsbipSession::list_devices() {
  // A free device that came back to the bus is found again, as by a hub.
  const auto offered = [](const UsbipBus::Port& port) {
    if (!port.in_use) {
      port.device->bus_reset();
    }
    return port.device->is_plugged();
  };
  std::vector<const UsbipBus::Port*> list;
  for (const UsbipBus::Port& port : bus_.ports()) {
    if (offered(port)) {
      list.push_back(&port);
    }
  }
  put_operation(output_, kReplyDeviceList, kOk);
  put32(output_, static_cast<std::uint32_t>(list.size()));
  for (const UsbipBus::Port* port : list) {
    put_device(*port);
    const auto parsed = parse_configuration(port->device->descriptors().configuration);
    for (const UsbInterface& interface : parsed->interfaces) {
      output_.insert(output_.end(), {interface.device_class, interface.subclass, interface.protocol,
                                     std::uint8_t{0}});
    }
  }
}

void UsbipSession::import(std::string_view busid) {
  UsbipBus::Port* port = bus_.find(busid);
  if (port != nullptr && !port->in_use) {
    port->device->bus_reset();
  }
  if (port == nullptr || !port->device->is_plugged() || port->in_use) {
    put_operation(output_, kReplyImport, port != nullptr && port->in_use ? kBusy : kNoDevice);
    end();
    return;
  }
  port_ = port;
  port_->in_use = true;
  port_->device->control(kConfigure, {});
  put_operation(output_, kReplyImport, kOk);
  put_device(*port_);
}

bool UsbipSession::take_command(std::span<const std::uint8_t>& bytes) {
  if (bytes.size() < kCommandBytes) {
    return false;
  }
  const std::uint32_t command = big32(bytes, 0);
  const std::uint32_t sequence = big32(bytes, 4);
  const std::uint32_t device_id = big32(bytes, 8);
  const std::uint32_t direction = big32(bytes, 12);
  const std::uint32_t endpoint = big32(bytes, 16);
  if (command == kUnlink) {
    unlink(sequence, big32(bytes, 20));
    bytes = bytes.subspan(kCommandBytes);
    return true;
  }
  Request request;
  request.sequence = sequence;
  request.flags = big32(bytes, 20);
  request.length = big32(bytes, 24);
  request.packets = big32(bytes, 32);
  if (command != kSubmit || direction > 1 || endpoint > 15 ||
      request.length > limits_.transfer_bytes ||
      (request.packets != 0 && request.packets != kNotIsochronous) ||
      requests_ >= limits_.requests) {
    end();  // the next message cannot be found, or the peer sends too much
    return false;
  }
  const bool towards_device = direction == 0;
  const std::size_t data = towards_device ? request.length : 0;
  if (bytes.size() - kCommandBytes < data) {
    return false;
  }
  request.setup = parse_setup(bytes.subspan<40, 8>());
  const auto content = bytes.subspan(kCommandBytes, data);
  request.data.assign(content.begin(), content.end());
  bytes = bytes.subspan(kCommandBytes + data);

  if (device_id != ((port_->bus_number << 16U) | port_->device_number)) {
    put_reply(kReplySubmit, sequence, kNoSuchDevice, 0, request.packets);
    return true;
  }
  const auto address =
      static_cast<std::uint8_t>(endpoint | (endpoint != 0 && !towards_device ? 0x80U : 0U));
  ++requests_;
  request_bytes_ += request.data.size();
  waiting_[address].push_back(std::move(request));
  return true;
}

void UsbipSession::unlink(std::uint32_t sequence, std::uint32_t victim) {
  // First serve what was submitted before.
  pump();
  for (auto& [address, queue] : waiting_) {
    const auto found = std::find_if(queue.begin(), queue.end(), [victim](const Request& request) {
      return request.sequence == victim;
    });
    if (found != queue.end()) {
      --requests_;
      request_bytes_ -= found->data.size();
      queue.erase(found);
      put_reply(kReplyUnlink, sequence, kUnlinked, 0, 0);
      return;
    }
  }
  put_reply(kReplyUnlink, sequence, 0, 0, 0);  // it was answered already
}

UsbAnswer UsbipSession::try_once(std::uint8_t address, const Request& request) {
  UsbDevice& device = *port_->device;
  if (address != 0) {
    return (address & 0x80U) != 0 ? device.in(address, request.length)
                                  : device.out(address, request.data);
  }
  if (request.setup.request_type == kHubPortRequest && request.setup.request == kSetFeature &&
      request.setup.value == kPortReset) {
    device.bus_reset();
    return device.control(kConfigure, {});
  }
  return device.control(request.setup, request.data);
}

void UsbipSession::pump() {
  if (port_ == nullptr) {
    return;
  }
  asked_at_ = port_->device->clock().elapsed();
  // A transfer on one endpoint may complete one on another: repeat until nothing moves.
  for (bool moved = true; moved;) {
    moved = false;
    for (auto& [address, queue] : waiting_) {
      while (!queue.empty() && output().size() < limits_.waiting_bytes) {
        const UsbAnswer answer = try_once(address, queue.front());
        if (answer.kind == UsbAnswer::Kind::nothing_yet) {
          break;
        }
        const Request request = std::move(queue.front());
        queue.pop_front();
        --requests_;
        request_bytes_ -= request.data.size();
        complete(address, request, answer);
        moved = true;
      }
    }
  }
  if (!port_->device->is_plugged()) {
    for (const auto& [address, queue] : waiting_) {
      for (const Request& request : queue) {
        complete(address, request, UsbAnswer::gone());
      }
    }
    end();
  }
}

void UsbipSession::complete(std::uint8_t address, const Request& request, const UsbAnswer& answer) {
  const bool towards_device =
      address == 0 ? !request.setup.device_to_host() : (address & 0x80U) == 0;
  std::int32_t status = 0;
  switch (answer.kind) {
    case UsbAnswer::Kind::stall:
      status = kStalled;
      break;
    case UsbAnswer::Kind::overflow:
      status = kOverflow;
      break;
    case UsbAnswer::Kind::gone:
    case UsbAnswer::Kind::nothing_yet:
      status = kGone;
      break;
    case UsbAnswer::Kind::done:
      break;
  }
  if (towards_device || status != 0) {
    const auto moved = static_cast<std::uint32_t>(status == 0 ? request.data.size() : 0);
    put_reply(kReplySubmit, request.sequence, status, moved, request.packets);
    return;
  }
  // A control answer fits wLength; the host's buffer may be smaller still.
  const std::size_t length = std::min<std::size_t>(answer.bytes.size(), request.length);
  if (length < request.length && (request.flags & kShortNotOk) != 0) {
    status = kShort;
  }
  put_reply(kReplySubmit, request.sequence, status, static_cast<std::uint32_t>(length),
            request.packets);
  output_.insert(output_.end(), answer.bytes.begin(),
                 answer.bytes.begin() + static_cast<std::ptrdiff_t>(length));
}

void UsbipSession::put_reply(std::uint32_t command, std::uint32_t sequence, std::int32_t status,
                             std::uint32_t actual_length, std::uint32_t packets) {
  // Device, direction and endpoint are 0: the host knows them by the sequence. Start frame, errors
  // and padding are 0.
  for (const std::uint32_t field :
       {command, sequence, 0U, 0U, 0U, static_cast<std::uint32_t>(status), actual_length, 0U,
        packets, 0U, 0U, 0U}) {
    put32(output_, field);
  }
}

std::optional<std::chrono::nanoseconds> UsbipSession::wait() const {
  if (port_ == nullptr || requests_ == 0) {
    return std::nullopt;
  }
  const auto due = port_->device->next_due();
  // Overdue data belong to an endpoint without a request.
  if (!due || *due <= asked_at_) {
    return std::nullopt;
  }
  return std::max(std::chrono::nanoseconds(0), *due - port_->device->clock().elapsed());
}

}  // namespace sixpoint::mocks
