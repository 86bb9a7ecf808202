#include "mocks/usb_device.h"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace sixpoint::mocks {

namespace {

// Descriptor types (USB 2.0, table 9-5; HID 1.11, section 7.1).
constexpr std::uint8_t kDevice = 1;
constexpr std::uint8_t kConfiguration = 2;
constexpr std::uint8_t kString = 3;
constexpr std::uint8_t kInterface = 4;
constexpr std::uint8_t kEndpoint = 5;
constexpr std::uint8_t kDeviceQualifier = 6;
constexpr std::uint8_t kHid = 0x21;
constexpr std::uint8_t kHidReport = 0x22;

constexpr std::uint8_t kHidClass = 3;
constexpr std::uint16_t kUsEnglish = 0x0409;

// Standard requests (USB 2.0, table 9-4).
constexpr std::uint8_t kGetStatus = 0;
constexpr std::uint8_t kClearFeature = 1;
constexpr std::uint8_t kSetFeature = 3;
constexpr std::uint8_t kSetAddress = 5;
constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint8_t kGetConfiguration = 8;
constexpr std::uint8_t kSetConfiguration = 9;
constexpr std::uint8_t kGetInterface = 10;
constexpr std::uint8_t kSetInterface = 11;
constexpr std::uint16_t kEndpointHalt = 0;

// HID class requests (HID 1.11, section 7.2).
constexpr std::uint8_t kGetIdle = 2;
constexpr std::uint8_t kSetIdle = 10;

enum class Recipient : std::uint8_t { device = 0, interface = 1, endpoint = 2, other = 3 };

Recipient recipient_of(const SetupPacket& setup) {
  return static_cast<Recipient>(std::min(setup.request_type & 0x1FU, 3U));
}

std::uint16_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8U));
}

tl::unexpected<Error> bad_descriptor(const char* what) {
  return fail(ErrorCode::bad_data, what, "configuration descriptor",
              "report this as a defect of the device");
}

// UTF-8 to UTF-16LE; what is no UTF-8 becomes U+FFFD.
void append_utf16(Bytes& out, std::string_view text) {
  const auto put = [&out](std::uint32_t unit) {
    out.push_back(static_cast<std::uint8_t>(unit & 0xFFU));
    out.push_back(static_cast<std::uint8_t>((unit >> 8U) & 0xFFU));
  };
  for (std::size_t at = 0; at < text.size();) {
    const auto lead = static_cast<std::uint8_t>(text[at++]);
    std::size_t more = 0;
    std::uint32_t point = lead;
    if (lead >= 0xF0U) {
      more = 3;
      point = lead & 0x07U;
    } else if (lead >= 0xE0U) {
      more = 2;
      point = lead & 0x0FU;
    } else if (lead >= 0xC0U) {
      more = 1;
      point = lead & 0x1FU;
    } else if (lead >= 0x80U) {
      point = 0xFFFDU;
    }
    while (more-- > 0) {
      if (at == text.size() || (static_cast<std::uint8_t>(text[at]) & 0xC0U) != 0x80U) {
        point = 0xFFFDU;
        break;
      }
      point = (point << 6U) | (static_cast<std::uint8_t>(text[at++]) & 0x3FU);
    }
    if (point >= 0x10000U) {
      put(0xD800U + (((point - 0x10000U) >> 10U) & 0x3FFU));
      put(0xDC00U + (point & 0x3FFU));
    } else {
      put(point);
    }
  }
}

}  // namespace

SetupPacket parse_setup(std::span<const std::uint8_t, 8> bytes) {
  return {bytes[0], bytes[1], little_endian(bytes, 2), little_endian(bytes, 4),
          little_endian(bytes, 6)};
}

std::uint16_t UsbDescriptors::vendor_id() const { return little_endian(device, 8); }
std::uint16_t UsbDescriptors::product_id() const { return little_endian(device, 10); }
std::string UsbDescriptors::serial() const {
  const auto found = strings.find(device[16]);
  return found == strings.end() ? std::string() : found->second;
}

Bytes string_descriptor(const UsbDescriptors& descriptors, std::uint8_t index) {
  Bytes bytes = {0, kString};
  if (index == 0) {
    bytes.push_back(kUsEnglish & 0xFFU);
    bytes.push_back(kUsEnglish >> 8U);
  } else {
    const auto found = descriptors.strings.find(index);
    if (found == descriptors.strings.end()) {
      return {};
    }
    append_utf16(bytes, found->second);
    bytes.resize(std::min<std::size_t>(bytes.size(), 254));  // bLength is one byte
  }
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

const UsbEndpoint* UsbConfiguration::endpoint(std::uint8_t address) const {
  const auto found =
      std::find_if(endpoints.begin(), endpoints.end(),
                   [address](const UsbEndpoint& endpoint) { return endpoint.address == address; });
  return found == endpoints.end() ? nullptr : &*found;
}

Result<UsbConfiguration> parse_configuration(std::span<const std::uint8_t> bytes) {
  UsbConfiguration configuration;
  if (bytes.size() < 9 || bytes[0] < 9 || bytes[1] != kConfiguration ||
      little_endian(bytes, 2) != bytes.size()) {
    return bad_descriptor("the total length is not that of the descriptor");
  }
  configuration.value = bytes[5];
  configuration.attributes = bytes[7];
  const std::size_t interfaces = bytes[4];
  for (auto rest = bytes.subspan(bytes[0]); !rest.empty(); rest = rest.subspan(rest[0])) {
    if (rest.size() < 2 || rest[0] < 2 || rest[0] > rest.size()) {
      return bad_descriptor("a descriptor is longer than the configuration");
    }
    if (rest[1] == kInterface && rest[0] >= 9) {
      configuration.interfaces.push_back({rest[2], rest[5], rest[6], rest[7], {}});
    } else if (configuration.interfaces.empty()) {
      return bad_descriptor("a descriptor stands before the first interface");
    } else if (rest[1] == kEndpoint && rest[0] >= 7) {
      configuration.endpoints.push_back({rest[2], static_cast<UsbEndpoint::Type>(rest[3] & 3U),
                                         little_endian(rest, 4),
                                         configuration.interfaces.back().number});
    } else if (rest[1] == kHid && rest[0] >= 9) {
      configuration.interfaces.back().hid_descriptor.assign(rest.begin(), rest.begin() + rest[0]);
    }
  }
  if (configuration.interfaces.size() != interfaces) {
    return bad_descriptor("the number of interfaces is not that of the descriptors");
  }
  return configuration;
}

StandardUsbDevice::StandardUsbDevice(UsbDescriptors descriptors, std::shared_ptr<Clock> clock)
    : clock_(std::move(clock)) {
  describe(std::move(descriptors));
}

void StandardUsbDevice::describe(UsbDescriptors descriptors) {
  descriptors_ = std::move(descriptors);
  auto parsed = parse_configuration(descriptors_.configuration);
  if (!parsed || descriptors_.device.size() != 18) {
    std::abort();  // the precondition
  }
  configuration_ = *std::move(parsed);
}

UsbAnswer StandardUsbDevice::control(const SetupPacket& setup, std::span<const std::uint8_t> data) {
  const std::lock_guard lock(mutex_);
  if (!plugged_ || !is_on_bus()) {
    return UsbAnswer::gone();
  }
  if (!setup.device_to_host() && data.size() != setup.length) {
    return UsbAnswer::stall();
  }
  UsbAnswer answer;
  if ((setup.request_type & 0x60U) == 0) {
    answer = standard_request(setup);
  } else if (configuration_value_ == 0 && recipient_of(setup) != Recipient::device) {
    answer = UsbAnswer::stall();
  } else if (auto hid = hid_request(setup)) {
    answer = *std::move(hid);
  } else {
    answer = own_request(setup, data);
  }
  if (answer.bytes.size() > setup.length) {
    answer.bytes.resize(setup.length);
  }
  return answer;
}

UsbAnswer StandardUsbDevice::own_request(const SetupPacket& /*setup*/,
                                         std::span<const std::uint8_t> /*data*/) {
  return UsbAnswer::stall();
}

const UsbInterface* StandardUsbDevice::interface(std::uint16_t number) const {
  const auto found =
      std::find_if(configuration_.interfaces.begin(), configuration_.interfaces.end(),
                   [number](const UsbInterface& interface) { return interface.number == number; });
  return found == configuration_.interfaces.end() ? nullptr : &*found;
}

UsbAnswer StandardUsbDevice::standard_request(const SetupPacket& setup) {
  // A request in the wrong direction is a request error (USB 2.0, section 9.2.7).
  const bool asks = setup.request == kGetStatus || setup.request == kGetDescriptor ||
                    setup.request == kGetConfiguration || setup.request == kGetInterface;
  if (asks != setup.device_to_host()) {
    return UsbAnswer::stall();
  }
  // Descriptors of an interface (HID) are asked for with this recipient.
  if (setup.request == kGetDescriptor) {
    return get_descriptor(setup);
  }
  switch (recipient_of(setup)) {
    case Recipient::device:
      break;
    case Recipient::interface:
      return interface_request(setup);
    case Recipient::endpoint:
      return endpoint_request(setup);
    case Recipient::other:
      return UsbAnswer::stall();
  }
  switch (setup.request) {
    case kGetStatus: {
      const auto self_powered = static_cast<std::uint8_t>((configuration_.attributes >> 6U) & 1U);
      return UsbAnswer::done({self_powered, 0});
    }
    case kSetAddress:
      // The carrier's bus has its own addresses; a host that sends it gets its yes.
      return setup.value < 128 ? UsbAnswer::done() : UsbAnswer::stall();
    case kGetConfiguration:
      return UsbAnswer::done({configuration_value_});
    case kSetConfiguration:
      if (setup.value != 0 && setup.value != configuration_.value) {
        return UsbAnswer::stall();
      }
      configuration_value_ = static_cast<std::uint8_t>(setup.value);
      halted_.clear();
      on_reset();
      return UsbAnswer::done();
    default:
      return UsbAnswer::stall();  // no remote wakeup, no test mode, descriptors cannot be set
  }
}

UsbAnswer StandardUsbDevice::get_descriptor(const SetupPacket& setup) const {
  const auto type = static_cast<std::uint8_t>(setup.value >> 8U);
  const auto index = static_cast<std::uint8_t>(setup.value & 0xFFU);
  if (recipient_of(setup) == Recipient::interface) {
    const UsbInterface* wanted = interface(setup.index);
    if (wanted == nullptr || wanted->device_class != kHidClass || index != 0) {
      return UsbAnswer::stall();
    }
    if (type == kHid) {
      return UsbAnswer::done(wanted->hid_descriptor);
    }
    const auto report = descriptors_.hid.find(wanted->number);
    return type == kHidReport && report != descriptors_.hid.end() ? UsbAnswer::done(report->second)
                                                                  : UsbAnswer::stall();
  }
  if (recipient_of(setup) != Recipient::device) {
    return UsbAnswer::stall();
  }
  switch (type) {
    case kDevice:
      return index == 0 ? UsbAnswer::done(descriptors_.device) : UsbAnswer::stall();
    case kConfiguration:
      return index == 0 ? UsbAnswer::done(descriptors_.configuration) : UsbAnswer::stall();
    case kString: {
      // Strings come in the one language of the table; hosts that ask without a language get it.
      if (index != 0 && setup.index != kUsEnglish && setup.index != 0) {
        return UsbAnswer::stall();
      }
      Bytes bytes = string_descriptor(descriptors_, index);
      return bytes.empty() ? UsbAnswer::stall() : UsbAnswer::done(std::move(bytes));
    }
    case kDeviceQualifier: {
      if (descriptors_.speed != UsbSpeed::high || index != 0) {
        return UsbAnswer::stall();
      }
      // At the other speed there is no configuration: the device is made for one speed.
      const Bytes& device = descriptors_.device;
      return UsbAnswer::done({10, kDeviceQualifier, device[2], device[3], device[4], device[5],
                              device[6], device[7], 0, 0});
    }
    default:
      return UsbAnswer::stall();
  }
}

UsbAnswer StandardUsbDevice::interface_request(const SetupPacket& setup) const {
  if (configuration_value_ == 0 || interface(setup.index) == nullptr) {
    return UsbAnswer::stall();
  }
  switch (setup.request) {
    case kGetStatus:
      return UsbAnswer::done({0, 0});
    case kGetInterface:
      return UsbAnswer::done({0});
    case kSetInterface:
      return setup.value == 0 ? UsbAnswer::done() : UsbAnswer::stall();
    default:
      return UsbAnswer::stall();
  }
}

UsbAnswer StandardUsbDevice::endpoint_request(const SetupPacket& setup) {
  const auto address = static_cast<std::uint8_t>(setup.index & 0x8FU);
  if (setup.index != address) {
    return UsbAnswer::stall();
  }
  const bool default_pipe = (address & 0x0FU) == 0;
  if (!default_pipe && (configuration_value_ == 0 || configuration_.endpoint(address) == nullptr)) {
    return UsbAnswer::stall();
  }
  switch (setup.request) {
    case kGetStatus:
      return UsbAnswer::done({static_cast<std::uint8_t>(halted_.contains(address) ? 1 : 0), 0});
    case kClearFeature:
      if (setup.value != kEndpointHalt) {
        return UsbAnswer::stall();
      }
      if (may_clear_halt(address)) {
        halted_.erase(address);
      }
      return UsbAnswer::done();
    case kSetFeature:
      if (setup.value != kEndpointHalt || default_pipe) {
        return UsbAnswer::stall();
      }
      halt(address);
      return UsbAnswer::done();
    default:
      return UsbAnswer::stall();
  }
}

std::optional<UsbAnswer> StandardUsbDevice::hid_request(const SetupPacket& setup) {
  constexpr std::uint8_t kClassOfInterface = 0x21;
  if ((setup.request_type & 0x7FU) != kClassOfInterface) {
    return std::nullopt;
  }
  const UsbInterface* wanted = interface(setup.index);
  if (wanted == nullptr || wanted->device_class != kHidClass) {
    return std::nullopt;
  }
  if (setup.request == kSetIdle && !setup.device_to_host()) {
    // There are no report ids: only that of report 0, which means all.
    if ((setup.value & 0xFFU) != 0) {
      return UsbAnswer::stall();
    }
    idle_rate_[wanted->number] = static_cast<std::uint8_t>(setup.value >> 8U);
    return UsbAnswer::done();
  }
  if (setup.request == kGetIdle && setup.device_to_host()) {
    return (setup.value & 0xFFU) == 0 ? UsbAnswer::done({idle_rate_[wanted->number]})
                                      : UsbAnswer::stall();
  }
  return std::nullopt;
}

UsbAnswer StandardUsbDevice::out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
  const std::lock_guard lock(mutex_);
  if (!plugged_ || !is_on_bus()) {
    return UsbAnswer::gone();
  }
  const UsbEndpoint* target = configuration_.endpoint(endpoint);
  if (configuration_value_ == 0 || target == nullptr || (endpoint & 0x80U) != 0 ||
      halted_.contains(endpoint)) {
    return UsbAnswer::stall();
  }
  return take(*target, bytes);
}

UsbAnswer StandardUsbDevice::in(std::uint8_t endpoint, std::size_t max_length) {
  const std::lock_guard lock(mutex_);
  if (!plugged_ || !is_on_bus()) {
    return UsbAnswer::gone();
  }
  const UsbEndpoint* source = configuration_.endpoint(endpoint);
  if (configuration_value_ == 0 || source == nullptr || (endpoint & 0x80U) == 0 ||
      halted_.contains(endpoint)) {
    return UsbAnswer::stall();
  }
  return give(*source, max_length);
}

bool StandardUsbDevice::is_plugged() const {
  const std::lock_guard lock(mutex_);
  return plugged_ && is_on_bus();
}

void StandardUsbDevice::reset() {
  configuration_value_ = 0;
  halted_.clear();
  idle_rate_.clear();
  on_reset();
}

void StandardUsbDevice::bus_reset() {
  const std::lock_guard lock(mutex_);
  reset();
}

void StandardUsbDevice::unplug() {
  const std::lock_guard lock(mutex_);
  plugged_ = false;
  on_plug(false);
}

void StandardUsbDevice::plug_in() {
  const std::lock_guard lock(mutex_);
  on_plug(true);
  reset();
  plugged_ = true;
}

void TransferQueue::put(Bytes message) {
  rest_ = std::move(message);
  at_ = 0;
  owes_empty_packet_ = rest_.empty();
}

UsbAnswer TransferQueue::next(std::size_t max_length) {
  if (empty()) {
    return UsbAnswer::nothing_yet();
  }
  const std::size_t left = rest_.size() - at_;
  if (left == 0) {
    clear();
    return UsbAnswer::done();
  }
  if (left > max_length) {
    // Whole packets fit, or the last one overflows the host's buffer and is lost with the rest.
    if (max_length % max_packet_ != 0) {
      clear();
      return {UsbAnswer::Kind::overflow, {}};
    }
    const auto begin = rest_.begin() + static_cast<std::ptrdiff_t>(at_);
    at_ += max_length;
    return UsbAnswer::done(Bytes(begin, begin + static_cast<std::ptrdiff_t>(max_length)));
  }
  UsbAnswer answer =
      UsbAnswer::done(Bytes(rest_.begin() + static_cast<std::ptrdiff_t>(at_), rest_.end()));
  const bool ends_on_packet = left == max_length && left % max_packet_ == 0;
  clear();
  owes_empty_packet_ = ends_on_packet;
  return answer;
}

void TransferQueue::clear() {
  rest_.clear();
  at_ = 0;
  owes_empty_packet_ = false;
}

}  // namespace sixpoint::mocks
