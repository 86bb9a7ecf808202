#include "mocks/usb/usb_device.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include <linux/hid.h>
#include <linux/usb/ch9.h>

#include "mocks/usb/usb_descriptors.h"

namespace sixpoint::mocks {

namespace {

enum class Recipient : std::uint8_t { device = 0, interface = 1, endpoint = 2, other = 3 };

Recipient recipient_of(const SetupPacket& setup) {
  return static_cast<Recipient>(std::min(setup.request_type & 0x1FU, 3U));
}

}  // namespace

SetupPacket parse_setup(std::span<const std::uint8_t, 8> bytes) {
  return {bytes[0], bytes[1], little_endian(bytes, 2), little_endian(bytes, 4),
          little_endian(bytes, 6)};
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

UsbAnswer StandardUsbDevice::standard_request(const SetupPacket& setup) {
  // A request in the wrong direction is a request error (USB 2.0, section 9.2.7).
  const bool asks =
      setup.request == USB_REQ_GET_STATUS || setup.request == USB_REQ_GET_DESCRIPTOR ||
      setup.request == USB_REQ_GET_CONFIGURATION || setup.request == USB_REQ_GET_INTERFACE;
  if (asks != setup.device_to_host()) {
    return UsbAnswer::stall();
  }
  // Descriptors of an interface (HID) are asked for with this recipient.
  if (setup.request == USB_REQ_GET_DESCRIPTOR) {
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
    case USB_REQ_GET_STATUS: {
      const auto self_powered = static_cast<std::uint8_t>((configuration_.attributes >> 6U) & 1U);
      return UsbAnswer::done({self_powered, 0});
    }
    case USB_REQ_SET_ADDRESS:
      // The carrier's bus has addresses of its own; the request is accepted.
      return setup.value < 128 ? UsbAnswer::done() : UsbAnswer::stall();
    case USB_REQ_GET_CONFIGURATION:
      return UsbAnswer::done({configuration_value_});
    case USB_REQ_SET_CONFIGURATION:
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
    const UsbInterface* wanted = configuration_.interface(setup.index);
    if (wanted == nullptr || wanted->device_class != kHidClass || index != 0) {
      return UsbAnswer::stall();
    }
    if (type == HID_DT_HID) {
      return UsbAnswer::done(wanted->hid_descriptor);
    }
    const auto report = descriptors_.hid.find(wanted->number);
    return type == HID_DT_REPORT && report != descriptors_.hid.end()
               ? UsbAnswer::done(report->second)
               : UsbAnswer::stall();
  }
  if (recipient_of(setup) != Recipient::device) {
    return UsbAnswer::stall();
  }
  switch (type) {
    case USB_DT_DEVICE:
      return index == 0 ? UsbAnswer::done(descriptors_.device) : UsbAnswer::stall();
    case USB_DT_CONFIG:
      return index == 0 ? UsbAnswer::done(descriptors_.configuration) : UsbAnswer::stall();
    case USB_DT_STRING: {
      // Strings come in the one language of the table; hosts that ask without a language get it.
      if (index != 0 && setup.index != kUsEnglish && setup.index != 0) {
        return UsbAnswer::stall();
      }
      Bytes bytes = string_descriptor(descriptors_, index);
      return bytes.empty() ? UsbAnswer::stall() : UsbAnswer::done(std::move(bytes));
    }
    case USB_DT_DEVICE_QUALIFIER: {
      if (descriptors_.speed != UsbSpeed::high || index != 0) {
        return UsbAnswer::stall();
      }
      // At the other speed there is no configuration: the device is made for one speed.
      const Bytes& device = descriptors_.device;
      return UsbAnswer::done({10, USB_DT_DEVICE_QUALIFIER, device[2], device[3], device[4],
                              device[5], device[6], device[7], 0, 0});
    }
    default:
      return UsbAnswer::stall();
  }
}

UsbAnswer StandardUsbDevice::interface_request(const SetupPacket& setup) const {
  if (configuration_value_ == 0 || configuration_.interface(setup.index) == nullptr) {
    return UsbAnswer::stall();
  }
  switch (setup.request) {
    case USB_REQ_GET_STATUS:
      return UsbAnswer::done({0, 0});
    case USB_REQ_GET_INTERFACE:
      return UsbAnswer::done({0});
    case USB_REQ_SET_INTERFACE:
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
    case USB_REQ_GET_STATUS:
      return UsbAnswer::done({static_cast<std::uint8_t>(halted_.contains(address) ? 1 : 0), 0});
    case USB_REQ_CLEAR_FEATURE:
      if (setup.value != USB_ENDPOINT_HALT) {
        return UsbAnswer::stall();
      }
      if (may_clear_halt(address)) {
        halted_.erase(address);
      }
      return UsbAnswer::done();
    case USB_REQ_SET_FEATURE:
      if (setup.value != USB_ENDPOINT_HALT || default_pipe) {
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
  const UsbInterface* wanted = configuration_.interface(setup.index);
  if (wanted == nullptr || wanted->device_class != kHidClass) {
    return std::nullopt;
  }
  if (setup.request == HID_REQ_SET_IDLE && !setup.device_to_host()) {
    // There are no report ids: only that of report 0, which means all.
    if ((setup.value & 0xFFU) != 0) {
      return UsbAnswer::stall();
    }
    idle_rate_[wanted->number] = static_cast<std::uint8_t>(setup.value >> 8U);
    return UsbAnswer::done();
  }
  if (setup.request == HID_REQ_GET_IDLE && setup.device_to_host()) {
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
