#include "mocks/umockdev/umockdev_port.h"

#include <cerrno>

#include <fmt/format.h>

namespace sixpoint::mocks {

namespace {

constexpr std::size_t kHidrawReports = 64;  // HIDRAW_BUFFER_SIZE of the kernel
// The longest wait while requests are pending and the device names no time: a fault may end.
constexpr nanoseconds kPollInterval = std::chrono::milliseconds(20);

nanoseconds machine_now() { return std::chrono::steady_clock::now().time_since_epoch(); }

// What an answer of the device is to a URB: 0 or the kernel's status, or nothing yet.
std::optional<int> status_of(const UsbAnswer& answer) {
  switch (answer.kind) {
    case UsbAnswer::Kind::done:
      return 0;
    case UsbAnswer::Kind::nothing_yet:
      return std::nullopt;
    case UsbAnswer::Kind::stall:
      return -EPIPE;
    case UsbAnswer::Kind::overflow:
      return -EOVERFLOW;
    case UsbAnswer::Kind::gone:
      return -ESHUTDOWN;
  }
  return -EIO;
}

}  // namespace

UmockdevPort::UmockdevPort(UmockdevShared& shared, std::shared_ptr<UsbDevice> device,
                           UsbConfiguration configuration, PluggedNodes nodes)
    : shared_(shared),
      device_(std::move(device)),
      configuration_(std::move(configuration)),
      nodes_(std::move(nodes)) {
  constexpr std::uint8_t kSetConfiguration = 9;
  device_->control({0x00, kSetConfiguration, configuration_.value, 0, 0}, {});
  for (const UsbInterface& interface : configuration_.interfaces) {
    bind_driver(interface);
    if (interface.device_class != kHidClass || hid_interface_) {
      continue;
    }
    hid_interface_ = interface.number;
    for (const UsbEndpoint& endpoint : configuration_.endpoints) {
      if (endpoint.interface == interface.number) {
        ((endpoint.address & 0x80U) != 0 ? hid_in_ : hid_out_) = endpoint.address;
      }
    }
  }
}

void UmockdevPort::set_hidraw(int hidraw) {
  nodes_.hidraw_node = fmt::format("/dev/hidraw{}", hidraw);
}

bool UmockdevPort::make_nodes(const std::string& root) {
  usb_ = std::make_unique<PollNode>(root + nodes_.usb_node, false);
  if (has_hid()) {
    hid_ = std::make_unique<PollNode>(root + nodes_.hidraw_node, true);
  }
  return usb_->ok() && (!hid_ || hid_->ok());
}

std::vector<std::string> UmockdevPort::node_files() const {
  std::vector<std::string> files = {usb_->path()};
  if (hid_) {
    files.push_back(hid_->path());
  }
  return files;
}

// True when the device has answered it.
bool UmockdevPort::carry_out(Urb& urb) {
  const auto length = static_cast<std::size_t>(std::max(urb.buffer_length, 0));
  const auto sent = urb.buffer ? bytes_of(urb.buffer.get()) : std::span<const std::uint8_t>();
  UsbAnswer answer;
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL) {
    const SetupPacket setup = parse_setup(sent.first<8>());
    answer = device_->control(
        setup, setup.device_to_host() ? std::span<const std::uint8_t>() : sent.subspan(8));
    urb.received = answer.bytes;
    urb.actual_length = setup.device_to_host() ? static_cast<int>(answer.bytes.size())
                                               : static_cast<int>(sent.size() - 8);
  } else if ((urb.endpoint & 0x80U) != 0) {
    answer = device_->in(urb.endpoint, length);
    urb.received = answer.bytes;
    urb.actual_length = static_cast<int>(answer.bytes.size());
  } else {
    answer = device_->out(urb.endpoint, sent);
    urb.actual_length = answer.kind == UsbAnswer::Kind::done ? static_cast<int>(length) : 0;
  }
  const auto status = status_of(answer);
  urb.status = status.value_or(0);
  return status.has_value();
}

void UmockdevPort::finish(Urb urb, int status) {
  urb.status = status;
  if (status != 0) {
    urb.actual_length = 0;
    urb.received.clear();
  }
  reapable_.push_back(std::move(urb));
}

void UmockdevPort::serve() {
  forget_closed_files();
  if (!gone_) {
    serve_urbs();
    serve_hid_writes();
    serve_hid_reads();
  }
  usb_->set_ready(!reapable_.empty());
  if (hid_) {
    hid_->set_ready(gone_ || !reports_.empty());
  }
}

// Each endpoint in the order of submission: a transfer that waits makes the later ones wait.
void UmockdevPort::serve_urbs() {
  std::set<std::uint8_t> blocked;
  for (auto urb = pending_.begin(); urb != pending_.end();) {
    if (!blocked.contains(urb->endpoint) && carry_out(*urb)) {
      const int status = urb->status;
      finish(std::move(*urb), status);
      urb = pending_.erase(urb);
    } else {
      blocked.insert(urb->endpoint);
      ++urb;
    }
  }
}

void UmockdevPort::serve_hid_writes() {
  while (!hid_writes_.empty()) {
    HidWrite& write = hid_writes_.front();
    auto status = status_of(device_->out(hid_out_, write.report));
    if (!status && machine_now() < write.deadline) {
      return;
    }
    const int error = -status.value_or(-ETIMEDOUT);
    umockdev_ioctl_client_complete(write.client.get(),
                                   error == 0 ? static_cast<glong>(write.count) : -1, error);
    hid_writes_.pop_front();
  }
}

// As the driver usbhid: it reads reports while a program has the node open.
void UmockdevPort::serve_hid_reads() {
  while (hid_ && !readers_.empty() && machine_now() >= stalled_until_) {
    const UsbAnswer answer = device_->in(hid_in_, 64);
    if (answer.kind == UsbAnswer::Kind::stall) {
      // The driver clears the halt and asks again, less often (hid_io_error).
      clear_halt(hid_in_);
      stalled_until_ = machine_now() + std::chrono::milliseconds(13);
    }
    if (answer.kind != UsbAnswer::Kind::done) {
      return;
    }
    if (reports_.size() < kHidrawReports) {
      reports_.push_back(answer.bytes);
    }
  }
}

UsbAnswer UmockdevPort::clear_halt(std::uint16_t endpoint) {
  constexpr std::uint8_t kClearFeature = 1;
  return device_->control({0x02, kClearFeature, 0, endpoint, 0}, {});
}

std::optional<nanoseconds> UmockdevPort::wait_time() const {
  if (gone_ || (pending_.empty() && hid_writes_.empty() && readers_.empty())) {
    return std::nullopt;
  }
  const auto due = device_->next_due();
  if (!due) {
    return kPollInterval;
  }
  return std::clamp<nanoseconds>(*due - device_->clock().elapsed(), std::chrono::microseconds(100),
                                 kPollInterval);
}

void UmockdevPort::unplug() {
  device_->unplug();
  gone_ = true;
  for (Urb& urb : pending_) {
    finish(std::move(urb), -ESHUTDOWN);
  }
  pending_.clear();
  for (HidWrite& write : hid_writes_) {
    umockdev_ioctl_client_complete(write.client.get(), -1, ENODEV);
  }
  hid_writes_.clear();
  serve();
}

template <auto kAnswer>
gboolean UmockdevPort::on_call(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                               gpointer port) {
  auto& self = *static_cast<UmockdevPort*>(port);
  const std::lock_guard lock(self.shared_.mutex);
  if (const auto result = (self.*kAnswer)(client)) {
    umockdev_ioctl_client_complete(client, result->value, result->value < 0 ? result->error : 0);
  }
  return TRUE;
}

void UmockdevPort::on_connected(UMockdevIoctlBase* base, UMockdevIoctlClient* client,
                                gpointer port) {
  auto& self = *static_cast<UmockdevPort*>(port);
  const std::lock_guard lock(self.shared_.mutex);
  self.clients_.emplace(client, static_cast<UMockdevIoctlClient*>(g_object_ref(client)));
  if (base == self.hid_handler_) {
    self.readers_.insert(client);
    self.shared_.wake.notify_all();
  }
}

// A closed file gives up its claims and its transfers, whether its program closed it or was killed.
// umockdev declares signals for that and never sends them.
void UmockdevPort::forget_closed_files() {
  for (auto at = clients_.begin(); at != clients_.end();) {
    UMockdevIoctlClient* const client = at->first;
    if (umockdev_ioctl_client_get_connected(client) != FALSE) {
      ++at;
      continue;
    }
    if (readers_.erase(client) > 0 && readers_.empty()) {
      reports_.clear();
    }
    std::erase_if(claimed_, [client](const auto& owner) { return owner.second == client; });
    const auto is_its = [client](const Urb& urb) { return urb.client == client; };
    std::erase_if(pending_, is_its);
    std::erase_if(reapable_, is_its);
    at = clients_.erase(at);
  }
}

bool UmockdevPort::attach(UMockdevTestbed* testbed) {
  const auto connect = [&](const std::string& node, UMockdevIoctlBase* handler) {
    g_signal_connect(handler, "client-connected", G_CALLBACK(on_connected), this);
    return umockdev_testbed_attach_ioctl(testbed, node.c_str(), handler, nullptr) != FALSE;
  };
  usb_handler_ = umockdev_ioctl_base_new();
  g_signal_connect(usb_handler_, "handle-ioctl", G_CALLBACK(on_call<&UmockdevPort::usb_ioctl>),
                   this);
  if (!connect(nodes_.usb_node, usb_handler_)) {
    return false;
  }
  if (!has_hid()) {
    return true;
  }
  hid_handler_ = umockdev_ioctl_base_new();
  g_signal_connect(hid_handler_, "handle-ioctl", G_CALLBACK(on_call<&UmockdevPort::hid_ioctl>),
                   this);
  g_signal_connect(hid_handler_, "handle-read", G_CALLBACK(on_call<&UmockdevPort::hid_read>), this);
  g_signal_connect(hid_handler_, "handle-write", G_CALLBACK(on_call<&UmockdevPort::hid_write>),
                   this);
  return connect(nodes_.hidraw_node, hid_handler_);
}

void UmockdevPort::detach(UMockdevTestbed* testbed) {
  for (const auto& [handler, node] :
       {std::pair{usb_handler_, nodes_.usb_node}, std::pair{hid_handler_, nodes_.hidraw_node}}) {
    if (handler != nullptr) {
      umockdev_testbed_detach_ioctl(testbed, node.c_str(), nullptr);
      g_signal_handlers_disconnect_by_data(handler, this);
      g_object_unref(handler);
    }
  }
}

}  // namespace sixpoint::mocks
