// The hidraw node: what Linux 6.1 answers to hidapi.
#include <cerrno>

#include <fmt/format.h>
#include <linux/hidraw.h>
#include <sys/ioctl.h>

#include "mocks/umockdev/umockdev_port.h"

namespace sixpoint::mocks {

std::optional<UmockdevPort::CallResult> UmockdevPort::hid_ioctl(UMockdevIoctlClient* client) {
  const gulong request = umockdev_ioctl_client_get_request(client);
  const std::size_t size = (request >> _IOC_SIZESHIFT) & ((1U << _IOC_SIZEBITS) - 1U);
  if (gone_) {
    return CallResult{-1, ENODEV};
  }
  const ClientData target = resolve(umockdev_ioctl_client_get_arg(client), 0, size);
  if (!target) {
    return CallResult{-1, ENOTTY};
  }
  const auto text = [&](const std::string& name) {
    const std::size_t length = std::min(size, name.size() + 1);
    update(target.get(), 0, {reinterpret_cast<const std::uint8_t*>(name.c_str()), length});
    return CallResult{static_cast<long>(length)};
  };
  const UsbDescriptors& descriptors = device_->descriptors();
  const Bytes& report = descriptors.hid.at(*hid_interface_);
  switch (request) {
    case HIDIOCGRDESCSIZE:
      write_as(target.get(), static_cast<int>(report.size()));
      return CallResult{0};
    case HIDIOCGRDESC: {
      auto whole = read_as<hidraw_report_descriptor>(target.get());
      whole.size = std::min<std::uint32_t>(whole.size, static_cast<std::uint32_t>(report.size()));
      std::copy_n(report.begin(), whole.size, std::begin(whole.value));
      write_as(target.get(), whole);
      return CallResult{0};
    }
    case HIDIOCGRAWINFO:
      write_as(target.get(), hidraw_devinfo{3, static_cast<std::int16_t>(descriptors.vendor_id()),
                                            static_cast<std::int16_t>(descriptors.product_id())});
      return CallResult{0};
    default:
      break;
  }
  // The requests for text differ by the length of the buffer.
  switch ((request >> _IOC_NRSHIFT) & ((1U << _IOC_NRBITS) - 1U)) {
    case _IOC_NR(HIDIOCGRAWNAME(0)):
      return text("Sixpoint");
    case _IOC_NR(HIDIOCGRAWPHYS(0)):
      return text(fmt::format("usb-{}/input0", nodes_.port));
    case _IOC_NR(HIDIOCGRAWUNIQ(0)):
      return text(descriptors.serial());
    default:
      return CallResult{-1, ENOTTY};
  }
}

std::optional<UmockdevPort::CallResult> UmockdevPort::hid_read(UMockdevIoctlClient* client) {
  UMockdevIoctlData* buffer = umockdev_ioctl_client_get_arg(client);
  readers_.insert(client);
  CallResult result{-1, gone_ ? EIO : EAGAIN};  // a handler cannot wait, as a blocking read would
  if (!reports_.empty()) {
    const std::size_t count = std::min(reports_.front().size(), bytes_of(buffer).size());
    update(buffer, 0, std::span(reports_.front()).first(count));
    reports_.pop_front();
    result = {static_cast<long>(count), 0};
  }
  serve();
  return result;
}

std::optional<UmockdevPort::CallResult> UmockdevPort::hid_write(UMockdevIoctlClient* client) {
  const auto bytes = bytes_of(umockdev_ioctl_client_get_arg(client));
  if (gone_ || bytes.empty()) {
    return CallResult{-1, gone_ ? ENODEV : EINVAL};
  }
  constexpr nanoseconds kTimeOut = std::chrono::seconds(5);  // of the driver usbhid
  HidWrite write;
  write.client.reset(static_cast<UMockdevIoctlClient*>(g_object_ref(client)));
  // usbhid does not send the report's number where reports have none.
  write.report.assign(bytes.begin() + (bytes[0] == 0 ? 1 : 0), bytes.end());
  write.count = bytes.size();
  write.deadline = std::chrono::steady_clock::now().time_since_epoch() + kTimeOut;
  hid_writes_.push_back(std::move(write));
  serve();
  shared_.wake.notify_all();
  return std::nullopt;
}

}  // namespace sixpoint::mocks
