// The node of usbfs: what Linux 6.1 answers to the ioctls that libusb 1.0.26 sends.
#include <cerrno>
#include <cstddef>

#include <sys/ioctl.h>

#include "mocks/umockdev/umockdev_port.h"

namespace sixpoint::mocks {

void UmockdevPort::bind_driver(const UsbInterface& interface) {
  if (interface.device_class == kHidClass || interface.device_class == kStorageClass) {
    drivers_[interface.number] = interface.device_class == kHidClass ? "usbhid" : "usb-storage";
  }
}

int UmockdevPort::claim(UMockdevIoctlClient* client, unsigned interface) {
  const auto number = static_cast<std::uint8_t>(interface);
  if (configuration_.interface(number) == nullptr) {
    return ENOENT;
  }
  forget_closed_files();
  if (const auto owner = claimed_.find(number); owner != claimed_.end()) {
    return owner->second == client ? 0 : EBUSY;
  }
  if (drivers_.contains(number)) {
    return EBUSY;
  }
  claimed_[number] = client;
  return 0;
}

int UmockdevPort::release(UMockdevIoctlClient* client, unsigned interface) {
  const auto owner = claimed_.find(static_cast<std::uint8_t>(interface));
  if (owner == claimed_.end() || owner->second != client) {
    return EINVAL;
  }
  claimed_.erase(owner);
  return 0;
}

int UmockdevPort::submit(UMockdevIoctlClient* client, ClientData data) {
  Urb urb;
  urb.client = client;
  urb.address = data->client_addr;
  // Not the structure itself: its end is an array without a size.
  const auto field = [&](std::size_t offset, auto value) {
    std::memcpy(&value, data->data + offset, sizeof(value));
    return value;
  };
  urb.type = field(offsetof(usbdevfs_urb, type), std::uint8_t{});
  urb.endpoint = field(offsetof(usbdevfs_urb, endpoint), std::uint8_t{});
  urb.buffer_length = field(offsetof(usbdevfs_urb, buffer_length), int{});
  if (urb.buffer_length < 0 || urb.type == USBDEVFS_URB_TYPE_ISO) {
    return EINVAL;
  }
  if (urb.buffer_length > 0) {
    urb.buffer = resolve(data.get(), offsetof(usbdevfs_urb, buffer),
                         static_cast<std::size_t>(urb.buffer_length));
    if (!urb.buffer) {
      return EFAULT;
    }
  }
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL) {
    if (urb.buffer_length < 8) {
      return EINVAL;
    }
  } else {
    const UsbEndpoint* endpoint = configuration_.endpoint(urb.endpoint);
    if (endpoint == nullptr) {
      return ENOENT;
    }
    // The kernel claims for a program that did not.
    if (const int error = claim(client, endpoint->interface); error != 0) {
      return error;
    }
  }
  urb.data = std::move(data);
  pending_.push_back(std::move(urb));
  return 0;
}

int UmockdevPort::discard(UMockdevIoctlClient* client, std::uint64_t address) {
  for (auto urb = pending_.begin(); urb != pending_.end(); ++urb) {
    if (urb->client == client && urb->address == address) {
      finish(std::move(*urb), -ENOENT);
      pending_.erase(urb);
      return 0;
    }
  }
  return EINVAL;  // has come back already
}

int UmockdevPort::reap(UMockdevIoctlClient* client, UMockdevIoctlData* pointer) {
  for (auto urb = reapable_.begin(); urb != reapable_.end(); ++urb) {
    if (urb->client != client) {
      continue;
    }
    const bool control = urb->type == USBDEVFS_URB_TYPE_CONTROL;
    if (urb->buffer && !urb->received.empty()) {
      const std::size_t begin = control ? 8 : 0;
      const std::size_t room = bytes_of(urb->buffer.get()).size() - begin;
      update(urb->buffer.get(), begin,
             std::span(urb->received).first(std::min(room, urb->received.size())));
    }
    const auto put = [&](std::size_t offset, int value) {
      update(urb->data.get(), offset,
             {reinterpret_cast<const std::uint8_t*>(&value), sizeof(value)});
    };
    put(offsetof(usbdevfs_urb, status), urb->status);
    put(offsetof(usbdevfs_urb, actual_length), urb->actual_length);
    if (umockdev_ioctl_data_set_ptr(pointer, 0, urb->data.get()) == FALSE) {
      return EFAULT;
    }
    reapable_.erase(urb);
    return 0;
  }
  return gone_ ? ENODEV : EAGAIN;
}

int UmockdevPort::get_driver(UMockdevIoctlData* target) const {
  auto driver = read_as<usbdevfs_getdriver>(target);
  const auto number = static_cast<std::uint8_t>(driver.interface);
  const auto found = drivers_.find(number);
  const bool claimed = claimed_.contains(number);
  if (found == drivers_.end() && !claimed) {
    return ENODATA;
  }
  const std::string name = claimed ? "usbfs" : found->second;
  std::fill(std::begin(driver.driver), std::end(driver.driver), '\0');
  std::copy(name.begin(), name.end(), std::begin(driver.driver));
  write_as(target, driver);
  return 0;
}

// USBDEVFS_IOCTL: detaching and attaching the kernel's driver of an interface.
int UmockdevPort::driver_ioctl(UMockdevIoctlClient* client, const usbdevfs_ioctl& command) {
  const auto number = static_cast<std::uint8_t>(command.ifno);
  switch (static_cast<unsigned>(command.ioctl_code)) {
    case USBDEVFS_DISCONNECT: {
      if (drivers_.erase(number) != 0) {
        return 0;
      }
      const auto owner = claimed_.find(number);
      return owner != claimed_.end() && owner->second != client ? EBUSY : ENODATA;
    }
    case USBDEVFS_CONNECT:
      if (const UsbInterface* interface = configuration_.interface(number)) {
        bind_driver(*interface);
      }
      return 0;
    default:
      return ENOTTY;
  }
}

int UmockdevPort::usbfs(UMockdevIoctlClient* client, gulong request, ClientData target) {
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      write_as(target.get(),
               std::uint32_t{USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                             USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_BULK_SCATTER_GATHER |
                             USBDEVFS_CAP_REAP_AFTER_DISCONNECT});
      return 0;
    case USBDEVFS_CLAIMINTERFACE:
      return claim(client, read_as<unsigned>(target.get()));
    case USBDEVFS_RELEASEINTERFACE:
      return release(client, read_as<unsigned>(target.get()));
    case USBDEVFS_GETDRIVER:
      return get_driver(target.get());
    case USBDEVFS_IOCTL:
      return driver_ioctl(client, read_as<usbdevfs_ioctl>(target.get()));
    case USBDEVFS_CLEAR_HALT: {
      const auto endpoint = static_cast<std::uint16_t>(read_as<unsigned>(target.get()));
      return clear_halt(endpoint).kind == UsbAnswer::Kind::done ? 0 : EPIPE;
    }
    case USBDEVFS_SUBMITURB:
      return submit(client, std::move(target));
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
      return reap(client, target.get());
    default:
      return ENOTTY;
  }
}

std::optional<UmockdevPort::CallResult> UmockdevPort::usb_ioctl(UMockdevIoctlClient* client) {
  UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
  const gulong request = umockdev_ioctl_client_get_request(client);
  const std::size_t size = (request >> _IOC_SIZESHIFT) & ((1U << _IOC_SIZEBITS) - 1U);
  int error = ENOTTY;
  if (gone_ && request != USBDEVFS_REAPURBNDELAY && request != USBDEVFS_REAPURB) {
    error = ENODEV;
  } else if (request == USBDEVFS_DISCARDURB) {
    error = discard(client, read_as<std::uint64_t>(argument));
  } else if (request == USBDEVFS_RESET) {
    device_->bus_reset();
    error = 0;
  } else if (ClientData target = size > 0 ? resolve(argument, 0, size) : ClientData()) {
    error = usbfs(client, request, std::move(target));
  }
  if (request != USBDEVFS_REAPURBNDELAY) {
    serve();
    shared_.wake.notify_all();
  } else {
    usb_->set_ready(!reapable_.empty());
  }
  return CallResult{error == 0 ? 0 : -1, error};
}

}  // namespace sixpoint::mocks
