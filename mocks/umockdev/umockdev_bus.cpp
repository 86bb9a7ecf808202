#include "mocks/umockdev/umockdev_bus.h"

#include <thread>

#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "mocks/umockdev/umockdev_port.h"

namespace sixpoint::mocks {

namespace {

constexpr int kBusNumber = 1;

}  // namespace

class UmockdevBus::Impl {
 public:
  Impl();
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Result<PluggedNodes> plug_in(std::shared_ptr<UsbDevice> device, std::string port);
  void unplug(const std::string& port);
  void allow(const std::string& port, bool allowed);

 private:
  void serve_ports();
  // The first port that is free; the caller holds the mutex.
  std::string free_port() const;

  UMockdevTestbed* testbed_;
  std::string root_;
  UmockdevShared shared_;
  bool stop_ = false;
  int next_address_ = 2;  // 1 is the root hub
  int next_hidraw_ = 0;
  std::map<std::string, std::unique_ptr<UmockdevPort>> ports_;
  // Programs may still have a node open: the handlers live as long as the bus.
  std::vector<std::unique_ptr<UmockdevPort>> left_;
  std::thread server_;
};

UmockdevBus::Impl::Impl() : testbed_(umockdev_testbed_new()) {
  gchar* root = umockdev_testbed_get_root_dir(testbed_);
  root_ = root;
  // mkdtemp() makes the folder for this user alone. A test that runs as another user must reach the
  // nodes, and be refused by them; a program that listens to events makes a socket there.
  ::chmod(root, 0777);
  g_free(root);
  server_ = std::thread([this] { serve_ports(); });
}

UmockdevBus::Impl::~Impl() {
  std::vector<std::string> ports;
  {
    const std::lock_guard lock(shared_.mutex);
    for (const auto& [name, port] : ports_) {
      ports.push_back(name);
    }
  }
  for (const std::string& port : ports) {
    unplug(port);
  }
  {
    const std::lock_guard lock(shared_.mutex);
    stop_ = true;
    shared_.wake.notify_all();
  }
  server_.join();
  for (auto& port : left_) {
    port->detach(testbed_);
  }
  left_.clear();
  g_object_unref(testbed_);
}

void UmockdevBus::Impl::serve_ports() {
  std::unique_lock lock(shared_.mutex);
  while (!stop_) {
    std::optional<nanoseconds> wait;
    for (const auto& [name, port] : ports_) {
      port->serve();
      if (const auto one = port->wait_time(); one && (!wait || *one < *wait)) {
        wait = one;
      }
    }
    if (wait) {
      shared_.wake.wait_for(lock, *wait);
    } else {
      shared_.wake.wait(lock);
    }
  }
}

std::string UmockdevBus::Impl::free_port() const {
  for (int number = 1;; ++number) {
    std::string port = fmt::format("{}-{}", kBusNumber, number);
    if (!ports_.contains(port)) {
      return port;
    }
  }
}

Result<PluggedNodes> UmockdevBus::Impl::plug_in(std::shared_ptr<UsbDevice> device,
                                                std::string port) {
  SIXPOINT_ASSIGN(UsbConfiguration configuration,
                  parse_configuration(device->descriptors().configuration));
  UmockdevPort* plugged = nullptr;
  std::string description;
  {
    const std::lock_guard lock(shared_.mutex);
    port = port.empty() ? free_port() : port;
    if (ports_.contains(port)) {
      return fail(ErrorCode::usage, "the port is taken", port, "unplug the device in it");
    }
    device->plug_in();
    PluggedNodes nodes{port, kBusNumber, next_address_++, {}, {}};
    nodes.usb_node = fmt::format("/dev/bus/usb/{:03}/{:03}", nodes.bus, nodes.address);
    auto made = std::make_unique<UmockdevPort>(shared_, std::move(device), std::move(configuration),
                                               std::move(nodes));
    if (made->has_hid()) {
      made->set_hidraw(next_hidraw_++);
    }
    if (!made->make_nodes(root_)) {
      return fail(ErrorCode::io, "cannot make a device node", root_, "is /tmp full?");
    }
    description = made->describe("/devices/pci0000:00/0000:00:14.0/usb1/" + port);
    plugged = made.get();
    ports_[port] = std::move(made);
  }
  // Without the lock: these calls reach umockdev's thread and the programs.
  if (!plugged->attach(testbed_)) {
    return fail(ErrorCode::internal, "umockdev does not take the handlers", port,
                "report this as a defect of the program");
  }
  // A program that may open a node may talk to its handler.
  for (const std::string& node : {plugged->nodes().usb_node, plugged->nodes().hidraw_node}) {
    ::chmod((root_ + "/ioctl" + node).c_str(), 0777);
  }
  GError* error = nullptr;
  if (umockdev_testbed_add_from_string(testbed_, description.c_str(), &error) == FALSE) {
    const std::string what = error == nullptr ? "" : error->message;
    g_clear_error(&error);
    return fail(ErrorCode::internal, "umockdev does not take the device: " + what, port,
                "report this as a defect of the program");
  }
  return plugged->nodes();
}

void UmockdevBus::Impl::unplug(const std::string& name) {
  UmockdevPort* port = nullptr;
  {
    const std::lock_guard lock(shared_.mutex);
    const auto found = ports_.find(name);
    if (found == ports_.end()) {
      return;
    }
    port = found->second.get();
    port->unplug();
    left_.push_back(std::move(found->second));
    ports_.erase(found);
  }
  for (auto path = port->paths().rbegin(); path != port->paths().rend(); ++path) {
    umockdev_testbed_uevent(testbed_, ("/sys" + *path).c_str(), "remove");
  }
  for (auto path = port->paths().rbegin(); path != port->paths().rend(); ++path) {
    umockdev_testbed_remove_device(testbed_, ("/sys" + *path).c_str());
  }
  for (const std::string& file : port->node_files()) {
    ::unlink(file.c_str());
  }
}

void UmockdevBus::Impl::allow(const std::string& port, bool allowed) {
  const std::lock_guard lock(shared_.mutex);
  if (const auto found = ports_.find(port); found != ports_.end()) {
    for (const std::string& file : found->second->node_files()) {
      ::chmod(file.c_str(), allowed ? 0666 : 0);
    }
  }
}

UmockdevBus::UmockdevBus(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
UmockdevBus::~UmockdevBus() = default;

Result<PluggedNodes> UmockdevBus::plug_in(std::shared_ptr<UsbDevice> device, std::string port) {
  return impl_->plug_in(std::move(device), std::move(port));
}

void UmockdevBus::unplug(const std::string& port) { impl_->unplug(port); }

void UmockdevBus::allow(const std::string& port, bool allowed) { impl_->allow(port, allowed); }

namespace {

constexpr const char* kPreload = "libumockdev-preload.so.0";

// umockdev_in_mock_environment() would answer false before the first testbed, and keep saying so.
bool is_preloaded() {
  const char* preload = ::getenv("LD_PRELOAD");
  return preload != nullptr && std::strstr(preload, kPreload) != nullptr;
}

}  // namespace

std::string UmockdevBus::enter(char** argv) {
  if (is_preloaded()) {
    return {};
  }
  if (::dlopen(kPreload, RTLD_LAZY | RTLD_LOCAL) == nullptr) {
    return fmt::format("{} is missing; install the Debian package umockdev", kPreload);
  }
  const char* before = ::getenv("LD_PRELOAD");
  const std::string all = before == nullptr ? kPreload : fmt::format("{}:{}", before, kPreload);
  ::setenv("LD_PRELOAD", all.c_str(), 1);
  ::execv("/proc/self/exe", argv);
  return "this program cannot start itself again with umockdev's preload library";
}

Result<std::unique_ptr<UmockdevBus>> UmockdevBus::make() {
  if (!is_preloaded()) {
    return fail(ErrorCode::configuration, "this process lacks umockdev's preload library", {},
                "call UmockdevBus::enter() first, or start the program with umockdev-wrapper");
  }
  return std::unique_ptr<UmockdevBus>(new UmockdevBus(std::make_unique<Impl>()));
}

}  // namespace sixpoint::mocks
