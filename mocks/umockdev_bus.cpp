#include "mocks/umockdev_bus.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <filesystem>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/hidraw.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <umockdev.h>
#include <unistd.h>

namespace sixpoint::mocks {

namespace {

using std::chrono::nanoseconds;

constexpr int kBusNumber = 1;
constexpr std::uint8_t kHidClass = 3;
constexpr std::uint8_t kStorageClass = 8;
constexpr std::size_t kHidrawReports = 64;  // HIDRAW_BUFFER_SIZE of the kernel
constexpr nanoseconds kHidWrite = std::chrono::seconds(5);
// While requests wait and the device does not say for when: a fault may end, a queue may fill.
constexpr nanoseconds kLook = std::chrono::milliseconds(20);

struct Unref {
  void operator()(UMockdevIoctlData* data) const { umockdev_ioctl_data_unref(data); }
  void operator()(UMockdevIoctlClient* client) const { g_object_unref(client); }
};
using Data = std::unique_ptr<UMockdevIoctlData, Unref>;
using Client = std::unique_ptr<UMockdevIoctlClient, Unref>;

// Memory of the client that `parent` points to at `offset`; null where it cannot be read.
Data resolve(UMockdevIoctlData* parent, std::size_t offset, std::size_t length) {
  GError* error = nullptr;
  Data data(umockdev_ioctl_data_resolve(parent, offset, length, &error));
  if (error != nullptr) {
    g_error_free(error);
  }
  return data;
}

void update(UMockdevIoctlData* data, std::size_t offset, std::span<const std::uint8_t> bytes) {
  // The library copies, its signature forgot to say so.
  umockdev_ioctl_data_update(data, offset, const_cast<guint8*>(bytes.data()),
                             static_cast<gint>(bytes.size()));
}

std::span<const std::uint8_t> bytes_of(const UMockdevIoctlData* data) {
  return {data->data, static_cast<std::size_t>(std::max(data->data_len, 0))};
}

template <class Plain>
Plain read_as(const UMockdevIoctlData* data) {
  Plain value{};
  std::memcpy(&value, data->data, std::min(sizeof(value), bytes_of(data).size()));
  return value;
}

template <class Plain>
void write_as(UMockdevIoctlData* data, const Plain& value) {
  update(data, 0, {reinterpret_cast<const std::uint8_t*>(&value), sizeof(value)});
}

// A named pipe whose readiness to poll() this side controls: umockdev answers reads, writes and
// ioctls, but poll() goes to the file itself.
class PollNode {
 public:
  PollNode(const std::string& path, bool ready_means_readable)
      : path_(path), readable_(ready_means_readable) {
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
    ::unlink(path.c_str());
    if (::mkfifo(path.c_str(), 0600) == 0) {
      fd_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    }
    if (fd_ >= 0) {
      // One page is one slot: a single byte fills it, and poll() says "not writable".
      ::fcntl(fd_, F_SETPIPE_SZ, 4096);
      has_byte_ = false;
      set_ready(false);
    }
  }
  ~PollNode() {
    if (fd_ >= 0) {
      ::close(fd_);
    }
    ::unlink(path_.c_str());
  }
  PollNode(const PollNode&) = delete;
  PollNode& operator=(const PollNode&) = delete;

  bool ok() const { return fd_ >= 0; }
  const std::string& path() const { return path_; }

  void set_ready(bool ready) {
    const bool byte = ready == readable_;
    if (byte == has_byte_) {
      return;
    }
    std::uint8_t one = 0;
    const ssize_t count = byte ? ::write(fd_, &one, 1) : ::read(fd_, &one, 1);
    has_byte_ = count == 1 ? byte : has_byte_;
  }

 private:
  std::string path_;
  bool readable_;
  int fd_ = -1;
  bool has_byte_ = false;
};

struct Urb {
  UMockdevIoctlClient* client = nullptr;  // who submitted it; only compared
  std::uint64_t address = 0;              // of the structure in the client
  Data data;                              // the structure
  Data buffer;                            // may be null when empty
  std::uint8_t type = 0;
  std::uint8_t endpoint = 0;
  int buffer_length = 0;
  int status = 0;
  Bytes came;
  int actual_length = 0;
};

struct HidWrite {
  Client client;
  Bytes report;
  nanoseconds deadline;
  std::size_t count = 0;
};

nanoseconds machine_now() { return std::chrono::steady_clock::now().time_since_epoch(); }

}  // namespace

class UmockdevBus::Impl {
 public:
  Impl() : testbed_(umockdev_testbed_new()) {
    gchar* root = umockdev_testbed_get_root_dir(testbed_);
    root_ = root;
    // mkdtemp() lets nobody else in; a test may want to be somebody else, and then be refused by
    // the nodes as on a real machine. (Who listens to events makes a socket there.)
    ::chmod(root, 0777);
    g_free(root);
    pump_ = std::thread([this] { pump(); });
  }

  ~Impl() {
    std::vector<std::string> ports;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [port, socket] : sockets_) {
        ports.push_back(port);
      }
    }
    for (const std::string& port : ports) {
      unplug(port);
    }
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
      wake_.notify_all();
    }
    pump_.join();
    for (auto& socket : left_) {
      detach(*socket);
    }
    left_.clear();
    g_object_unref(testbed_);
  }

  Result<PluggedNodes> plug_in(std::shared_ptr<UsbDevice> device, std::string port);
  void unplug(const std::string& port);
  void allow(const std::string& port, bool allowed);

 private:
  // A device in a port, and what programs have under way with it.
  struct Socket {
    Impl* bus = nullptr;
    std::shared_ptr<UsbDevice> device;
    UsbConfiguration configuration;
    PluggedNodes nodes;
    std::vector<std::string> paths;  // in sysfs, parents first
    std::unique_ptr<PollNode> usb;
    std::unique_ptr<PollNode> hid;
    UMockdevIoctlBase* usb_handler = nullptr;
    UMockdevIoctlBase* hid_handler = nullptr;
    std::uint8_t hid_interface = 0;
    std::uint8_t hid_in = 0;
    std::uint8_t hid_out = 0;
    bool gone = false;
    // By interface: the client that claimed it, or the kernel's driver.
    std::map<std::uint8_t, UMockdevIoctlClient*> claimed;
    std::map<std::uint8_t, std::string> drivers;
    std::deque<Urb> pending;
    std::deque<Urb> reapable;
    std::set<UMockdevIoctlClient*> readers;  // of the hidraw node
    std::deque<Bytes> reports;
    std::list<HidWrite> hid_writes;
    nanoseconds stalled_until{0};
  };

  static gboolean on_usb_ioctl(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);
  static gboolean on_hid_ioctl(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);
  static gboolean on_hid_read(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);
  static gboolean on_hid_write(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);
  static void on_connected(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);
  static void on_vanished(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer data);

  // Each answers as the system call would: result and errno. Callers hold the mutex.
  int claim(Socket& socket, UMockdevIoctlClient* client, unsigned interface);
  int release(Socket& socket, UMockdevIoctlClient* client, unsigned interface);
  int submit(Socket& socket, UMockdevIoctlClient* client, Data data);
  int discard(Socket& socket, UMockdevIoctlClient* client, std::uint64_t address);
  int reap(Socket& socket, UMockdevIoctlClient* client, UMockdevIoctlData* pointer);
  int driver_ioctl(Socket& socket, UMockdevIoctlClient* client, const usbdevfs_ioctl& command);

  void pump();
  void serve(Socket& socket);
  bool serve(Socket& socket, Urb& urb);
  void finish(Socket& socket, Urb urb, int status);
  std::optional<nanoseconds> wait_of(Socket& socket);
  std::string describe(Socket& socket, const std::string& path);
  bool attach(Socket& socket);
  void detach(Socket& socket);

  UMockdevTestbed* testbed_;
  std::string root_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  int next_address_ = 2;  // 1 is the root hub
  int next_hidraw_ = 0;
  std::map<std::string, std::unique_ptr<Socket>> sockets_;  // by port
  // Programs may still have a node open: the handler lives as long as the bus.
  std::vector<std::unique_ptr<Socket>> left_;
  std::thread pump_;
};

// What an answer of the device is to a URB: 0 or the kernel's status, or nothing yet.
static std::optional<int> status_of(const UsbAnswer& answer) {
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

// True when the device has answered it.
bool UmockdevBus::Impl::serve(Socket& socket, Urb& urb) {
  const auto length = static_cast<std::size_t>(std::max(urb.buffer_length, 0));
  const auto sent = urb.buffer ? bytes_of(urb.buffer.get()) : std::span<const std::uint8_t>();
  UsbAnswer answer;
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL) {
    const SetupPacket setup = parse_setup(sent.first<8>());
    answer = socket.device->control(
        setup, setup.device_to_host() ? std::span<const std::uint8_t>() : sent.subspan(8));
    urb.came = answer.bytes;
    urb.actual_length = setup.device_to_host() ? static_cast<int>(answer.bytes.size())
                                               : static_cast<int>(sent.size() - 8);
  } else if ((urb.endpoint & 0x80U) != 0) {
    answer = socket.device->in(urb.endpoint, length);
    urb.came = answer.bytes;
    urb.actual_length = static_cast<int>(answer.bytes.size());
  } else {
    answer = socket.device->out(urb.endpoint, sent);
    urb.actual_length = answer.kind == UsbAnswer::Kind::done ? static_cast<int>(length) : 0;
  }
  const auto status = status_of(answer);
  urb.status = status.value_or(0);
  return status.has_value();
}

void UmockdevBus::Impl::finish(Socket& socket, Urb urb, int status) {
  urb.status = status;
  if (status != 0) {
    urb.actual_length = 0;
    urb.came.clear();
  }
  socket.reapable.push_back(std::move(urb));
}

void UmockdevBus::Impl::serve(Socket& socket) {
  if (!socket.gone) {
    // One endpoint after the other in the order of submission: what waits makes the rest wait.
    std::set<std::uint8_t> blocked;
    for (auto urb = socket.pending.begin(); urb != socket.pending.end();) {
      if (blocked.count(urb->endpoint) != 0) {
        ++urb;
      } else if (serve(socket, *urb)) {
        const int status = urb->status;
        finish(socket, std::move(*urb), status);
        urb = socket.pending.erase(urb);
      } else {
        blocked.insert(urb->endpoint);
        ++urb;
      }
    }
    for (auto write = socket.hid_writes.begin(); write != socket.hid_writes.end();) {
      const auto status = status_of(socket.device->out(socket.hid_out, write->report));
      if (!status && machine_now() < write->deadline) {
        break;
      }
      if (!status) {
        umockdev_ioctl_client_complete(write->client.get(), -1, ETIMEDOUT);
      } else if (*status != 0) {
        umockdev_ioctl_client_complete(write->client.get(), -1, -*status);
      } else {
        umockdev_ioctl_client_complete(write->client.get(), static_cast<glong>(write->count), 0);
      }
      write = socket.hid_writes.erase(write);
    }
    // usbhid asks for reports while somebody has the node open.
    while (socket.hid && !socket.readers.empty() && machine_now() >= socket.stalled_until) {
      const UsbAnswer answer = socket.device->in(socket.hid_in, 64);
      if (answer.kind == UsbAnswer::Kind::stall) {
        // It clears the halt and asks again, less often (hid_io_error).
        socket.device->control({0x02, 1, 0, socket.hid_in, 0}, {});
        socket.stalled_until = machine_now() + std::chrono::milliseconds(13);
        break;
      }
      if (answer.kind != UsbAnswer::Kind::done) {
        break;
      }
      if (socket.reports.size() < kHidrawReports) {
        socket.reports.push_back(answer.bytes);
      }
    }
  }
  socket.usb->set_ready(!socket.reapable.empty());
  if (socket.hid) {
    socket.hid->set_ready(socket.gone || !socket.reports.empty());
  }
}

// How long the pump may sleep for this device; none: until somebody asks for something.
std::optional<nanoseconds> UmockdevBus::Impl::wait_of(Socket& socket) {
  if (socket.gone ||
      (socket.pending.empty() && socket.hid_writes.empty() && socket.readers.empty())) {
    return std::nullopt;
  }
  const auto due = socket.device->next_due();
  if (!due) {
    return kLook;
  }
  const nanoseconds left = *due - socket.device->clock().elapsed();
  return std::clamp<nanoseconds>(left, std::chrono::microseconds(100), kLook);
}

void UmockdevBus::Impl::pump() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    std::optional<nanoseconds> wait;
    for (const auto& [port, socket] : sockets_) {
      serve(*socket);
      if (const auto one = wait_of(*socket); one && (!wait || *one < *wait)) {
        wait = one;
      }
    }
    if (wait) {
      wake_.wait_for(lock, *wait);
    } else {
      wake_.wait(lock);
    }
  }
}

int UmockdevBus::Impl::claim(Socket& socket, UMockdevIoctlClient* client, unsigned interface) {
  const auto number = static_cast<std::uint8_t>(interface);
  const bool exists = std::any_of(
      socket.configuration.interfaces.begin(), socket.configuration.interfaces.end(),
      [interface](const UsbInterface& candidate) { return candidate.number == interface; });
  if (!exists) {
    return ENOENT;
  }
  if (const auto owner = socket.claimed.find(number); owner != socket.claimed.end()) {
    return owner->second == client ? 0 : EBUSY;
  }
  if (socket.drivers.count(number) != 0) {
    return EBUSY;
  }
  socket.claimed[number] = client;
  return 0;
}

int UmockdevBus::Impl::release(Socket& socket, UMockdevIoctlClient* client, unsigned interface) {
  const auto owner = socket.claimed.find(static_cast<std::uint8_t>(interface));
  if (owner == socket.claimed.end() || owner->second != client) {
    return EINVAL;
  }
  socket.claimed.erase(owner);
  return 0;
}

int UmockdevBus::Impl::submit(Socket& socket, UMockdevIoctlClient* client, Data data) {
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
    const UsbEndpoint* endpoint = socket.configuration.endpoint(urb.endpoint);
    if (endpoint == nullptr) {
      return ENOENT;
    }
    // The kernel claims for a program that forgot to, and grumbles.
    if (const int error = claim(socket, client, endpoint->interface); error != 0) {
      return error;
    }
  }
  urb.data = std::move(data);
  socket.pending.push_back(std::move(urb));
  return 0;
}

int UmockdevBus::Impl::discard(Socket& socket, UMockdevIoctlClient* client, std::uint64_t address) {
  for (auto urb = socket.pending.begin(); urb != socket.pending.end(); ++urb) {
    if (urb->client == client && urb->address == address) {
      finish(socket, std::move(*urb), -ENOENT);
      socket.pending.erase(urb);
      return 0;
    }
  }
  return EINVAL;  // has come back already
}

int UmockdevBus::Impl::reap(Socket& socket, UMockdevIoctlClient* client,
                            UMockdevIoctlData* pointer) {
  for (auto urb = socket.reapable.begin(); urb != socket.reapable.end(); ++urb) {
    if (urb->client != client) {
      continue;
    }
    const bool control = urb->type == USBDEVFS_URB_TYPE_CONTROL;
    if (urb->buffer && !urb->came.empty()) {
      const std::size_t begin = control ? 8 : 0;
      const std::size_t room = bytes_of(urb->buffer.get()).size() - begin;
      update(urb->buffer.get(), begin,
             std::span(urb->came).first(std::min(room, urb->came.size())));
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
    socket.reapable.erase(urb);
    return 0;
  }
  return socket.gone ? ENODEV : EAGAIN;
}

// USBDEVFS_IOCTL: detaching and attaching the kernel's driver of an interface.
int UmockdevBus::Impl::driver_ioctl(Socket& socket, UMockdevIoctlClient* client,
                                    const usbdevfs_ioctl& command) {
  const auto number = static_cast<std::uint8_t>(command.ifno);
  if (static_cast<unsigned>(command.ioctl_code) == USBDEVFS_DISCONNECT) {
    if (socket.drivers.erase(number) != 0) {
      return 0;
    }
    return socket.claimed.count(number) != 0 && socket.claimed[number] != client ? EBUSY : ENODATA;
  }
  if (static_cast<unsigned>(command.ioctl_code) == USBDEVFS_CONNECT) {
    for (const UsbInterface& interface : socket.configuration.interfaces) {
      if (interface.number == number && interface.device_class == kHidClass) {
        socket.drivers[number] = "usbhid";
      } else if (interface.number == number && interface.device_class == kStorageClass) {
        socket.drivers[number] = "usb-storage";
      }
    }
    return 0;
  }
  return ENOTTY;
}

gboolean UmockdevBus::Impl::on_usb_ioctl(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                         gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  Impl& self = *socket.bus;
  UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
  const gulong request = umockdev_ioctl_client_get_request(client);
  const std::size_t size = (request >> _IOC_SIZESHIFT) & ((1U << _IOC_SIZEBITS) - 1U);
  const std::lock_guard lock(self.mutex_);
  int error = ENOTTY;
  if (socket.gone && request != USBDEVFS_REAPURBNDELAY && request != USBDEVFS_REAPURB) {
    error = ENODEV;
  } else if (request == USBDEVFS_DISCARDURB) {
    error = self.discard(socket, client, read_as<std::uint64_t>(argument));
  } else if (request == USBDEVFS_RESET) {
    socket.device->bus_reset();
    error = 0;
  } else if (Data target = size > 0 ? resolve(argument, 0, size) : Data()) {
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES:
        write_as(target.get(),
                 std::uint32_t{USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                               USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_BULK_SCATTER_GATHER |
                               USBDEVFS_CAP_REAP_AFTER_DISCONNECT});
        error = 0;
        break;
      case USBDEVFS_CLAIMINTERFACE:
        error = self.claim(socket, client, read_as<unsigned>(target.get()));
        break;
      case USBDEVFS_RELEASEINTERFACE:
        error = self.release(socket, client, read_as<unsigned>(target.get()));
        break;
      case USBDEVFS_GETDRIVER: {
        auto driver = read_as<usbdevfs_getdriver>(target.get());
        const auto number = static_cast<std::uint8_t>(driver.interface);
        const auto found = socket.drivers.find(number);
        const bool claimed = socket.claimed.count(number) != 0;
        error = found == socket.drivers.end() && !claimed ? ENODATA : 0;
        if (error == 0) {
          const std::string name = claimed ? "usbfs" : found->second;
          std::fill(std::begin(driver.driver), std::end(driver.driver), '\0');
          std::copy(name.begin(), name.end(), std::begin(driver.driver));
          write_as(target.get(), driver);
        }
        break;
      }
      case USBDEVFS_IOCTL:
        error = self.driver_ioctl(socket, client, read_as<usbdevfs_ioctl>(target.get()));
        break;
      case USBDEVFS_CLEAR_HALT: {
        // CLEAR_FEATURE(ENDPOINT_HALT) to the endpoint.
        const auto endpoint = static_cast<std::uint16_t>(read_as<unsigned>(target.get()));
        const UsbAnswer answer = socket.device->control({0x02, 1, 0, endpoint, 0}, {});
        error = answer.kind == UsbAnswer::Kind::done ? 0 : EPIPE;
        break;
      }
      case USBDEVFS_SUBMITURB:
        error = self.submit(socket, client, std::move(target));
        break;
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY:
        error = self.reap(socket, client, target.get());
        break;
      default:
        break;
    }
  }
  if (request != USBDEVFS_REAPURBNDELAY) {
    self.serve(socket);
    self.wake_.notify_all();
  } else {
    socket.usb->set_ready(!socket.reapable.empty());
  }
  umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
  return TRUE;
}

gboolean UmockdevBus::Impl::on_hid_ioctl(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                         gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
  const gulong request = umockdev_ioctl_client_get_request(client);
  const std::size_t size = (request >> _IOC_SIZESHIFT) & ((1U << _IOC_SIZEBITS) - 1U);
  const std::lock_guard lock(socket.bus->mutex_);
  const UsbDescriptors& descriptors = socket.device->descriptors();
  const Bytes& report = descriptors.hid.at(socket.hid_interface);
  int result = -1;
  int error = ENOTTY;
  if (socket.gone) {
    error = ENODEV;
  } else if (Data target = resolve(argument, 0, size)) {
    const auto text = [&](const std::string& name) {
      const std::size_t length = std::min(size, name.size() + 1);
      update(target.get(), 0, {reinterpret_cast<const std::uint8_t*>(name.c_str()), length});
      result = static_cast<int>(length);
    };
    const unsigned number = (request >> _IOC_NRSHIFT) & ((1U << _IOC_NRBITS) - 1U);
    if (request == HIDIOCGRDESCSIZE) {
      write_as(target.get(), static_cast<int>(report.size()));
      result = 0;
    } else if (request == HIDIOCGRDESC) {
      auto whole = read_as<hidraw_report_descriptor>(target.get());
      whole.size = std::min<std::uint32_t>(whole.size, static_cast<std::uint32_t>(report.size()));
      std::copy_n(report.begin(), whole.size, std::begin(whole.value));
      write_as(target.get(), whole);
      result = 0;
    } else if (request == HIDIOCGRAWINFO) {
      write_as(target.get(), hidraw_devinfo{3, static_cast<std::int16_t>(descriptors.vendor_id()),
                                            static_cast<std::int16_t>(descriptors.product_id())});
      result = 0;
    } else if (number == _IOC_NR(HIDIOCGRAWNAME(0))) {
      text("Sixpoint");
    } else if (number == _IOC_NR(HIDIOCGRAWPHYS(0))) {
      text(fmt::format("usb-{}/input0", socket.nodes.port));
    } else if (number == _IOC_NR(HIDIOCGRAWUNIQ(0))) {
      text(descriptors.serial());
    }
  }
  umockdev_ioctl_client_complete(client, result, result < 0 ? error : 0);
  return TRUE;
}

gboolean UmockdevBus::Impl::on_hid_read(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                        gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  UMockdevIoctlData* buffer = umockdev_ioctl_client_get_arg(client);
  const std::lock_guard lock(socket.bus->mutex_);
  socket.readers.insert(client);
  long result = -1;
  int error = EAGAIN;  // a blocking read would wait; nobody here may
  if (socket.reports.empty() && socket.gone) {
    error = EIO;
  } else if (!socket.reports.empty()) {
    const Bytes report = std::move(socket.reports.front());
    socket.reports.pop_front();
    const std::size_t count = std::min(report.size(), bytes_of(buffer).size());
    update(buffer, 0, std::span(report).first(count));
    result = static_cast<long>(count);
    error = 0;
  }
  socket.bus->serve(socket);
  umockdev_ioctl_client_complete(client, result, error);
  return TRUE;
}

gboolean UmockdevBus::Impl::on_hid_write(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                         gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  const auto bytes = bytes_of(umockdev_ioctl_client_get_arg(client));
  const std::lock_guard lock(socket.bus->mutex_);
  if (socket.gone || bytes.empty()) {
    umockdev_ioctl_client_complete(client, -1, socket.gone ? ENODEV : EINVAL);
    return TRUE;
  }
  // usbhid does not send the number of a report where there are no numbers.
  HidWrite write;
  write.client.reset(static_cast<UMockdevIoctlClient*>(g_object_ref(client)));
  write.report.assign(bytes.begin() + (bytes[0] == 0 ? 1 : 0), bytes.end());
  write.count = bytes.size();
  write.deadline = machine_now() + kHidWrite;
  socket.hid_writes.push_back(std::move(write));
  socket.bus->serve(socket);
  socket.bus->wake_.notify_all();
  return TRUE;
}

void UmockdevBus::Impl::on_connected(UMockdevIoctlBase* base, UMockdevIoctlClient* client,
                                     gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  const std::lock_guard lock(socket.bus->mutex_);
  if (base == socket.hid_handler) {
    socket.readers.insert(client);
    socket.bus->wake_.notify_all();
  }
}

void UmockdevBus::Impl::on_vanished(UMockdevIoctlBase* base, UMockdevIoctlClient* client,
                                    gpointer data) {
  auto& socket = *static_cast<Socket*>(data);
  const std::lock_guard lock(socket.bus->mutex_);
  if (base == socket.hid_handler) {
    socket.readers.erase(client);
    if (socket.readers.empty()) {
      socket.reports.clear();
    }
  }
  // A closed file gives up its claims and its transfers.
  for (auto owner = socket.claimed.begin(); owner != socket.claimed.end();) {
    owner = owner->second == client ? socket.claimed.erase(owner) : std::next(owner);
  }
  const auto is_its = [client](const Urb& urb) { return urb.client == client; };
  std::erase_if(socket.pending, is_its);
  std::erase_if(socket.reapable, is_its);
  socket.usb->set_ready(!socket.reapable.empty());
}

namespace {

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += fmt::format("{:02X}", byte);
  }
  return text;
}

std::string string_at(const UsbDescriptors& descriptors, std::uint8_t index) {
  const auto found = descriptors.strings.find(index);
  return found == descriptors.strings.end() ? std::string() : found->second;
}

}  // namespace

// The device, its interfaces, its HID device and its hidraw node in sysfs, as `udevadm info` names
// attributes. Without "N:" lines: they would make plain files of the nodes.
std::string UmockdevBus::Impl::describe(Socket& socket, const std::string& path) {
  const UsbDescriptors& d = socket.device->descriptors();
  const PluggedNodes& nodes = socket.nodes;
  const std::string ids = fmt::format("{:04X}:{:04X}", d.vendor_id(), d.product_id());
  Bytes descriptors = d.device;
  descriptors.insert(descriptors.end(), d.configuration.begin(), d.configuration.end());
  const int speed_mbps = d.speed == UsbSpeed::high ? 480 : 12;

  std::string text = fmt::format(
      "P: {}\nE: DEVNAME={}\nE: DEVTYPE=usb_device\nE: DRIVER=usb\nE: SUBSYSTEM=usb\n"
      "E: BUSNUM={:03}\nE: DEVNUM={:03}\nE: MAJOR=189\nE: MINOR={}\nE: PRODUCT={:x}/{:x}/100\n"
      "A: busnum={}\nA: devnum={}\nA: idVendor={:04x}\nA: idProduct={:04x}\nA: speed={}\n"
      "A: bConfigurationValue={}\nA: bNumConfigurations=1\nA: bNumInterfaces={:2}\n"
      "A: bDeviceClass={:02x}\nA: manufacturer={}\nA: product={}\nA: serial={}\n"
      "H: descriptors={}\n\n",
      path, nodes.usb_node, nodes.bus, nodes.address, nodes.address - 1, d.vendor_id(),
      d.product_id(), nodes.bus, nodes.address, d.vendor_id(), d.product_id(), speed_mbps,
      socket.configuration.value, socket.configuration.interfaces.size(), d.device[4],
      string_at(d, d.device[14]), string_at(d, d.device[15]), d.serial(), hex(descriptors));
  socket.paths.push_back(path);
  for (const UsbInterface& interface : socket.configuration.interfaces) {
    const std::string child =
        fmt::format("{}/{}:{}.{}", path, nodes.port, socket.configuration.value, interface.number);
    const auto driver = socket.drivers.find(interface.number);
    text += fmt::format(
        "P: {}\nE: DEVTYPE=usb_interface\nE: SUBSYSTEM=usb\n{}"
        "A: bInterfaceNumber={:02x}\nA: bInterfaceClass={:02x}\nA: bInterfaceSubClass={:02x}\n"
        "A: bInterfaceProtocol={:02x}\nA: bAlternateSetting= 0\n\n",
        child, driver == socket.drivers.end() ? "" : fmt::format("E: DRIVER={}\n", driver->second),
        interface.number, interface.device_class, interface.subclass, interface.protocol);
    socket.paths.push_back(child);
    if (nodes.hidraw_node.empty() || interface.number != socket.hid_interface) {
      continue;
    }
    const std::string hid = fmt::format("{}/0003:{}.{:04X}", child, ids, nodes.address);
    const std::string raw = fmt::format("{}/hidraw/{}", hid, nodes.hidraw_node.substr(5));
    text += fmt::format(
        "P: {}\nE: SUBSYSTEM=hid\nE: DRIVER=hid-generic\nE: HID_ID=0003:0000{:04X}:0000{:04X}\n"
        "E: HID_NAME={} {}\nE: HID_PHYS=usb-{}/input0\nE: HID_UNIQ={}\nH: report_descriptor={}\n\n",
        hid, d.vendor_id(), d.product_id(), string_at(d, d.device[14]), string_at(d, d.device[15]),
        nodes.port, d.serial(), hex(d.hid.at(interface.number)));
    text += fmt::format(
        "P: {}\nE: DEVNAME={}\nE: SUBSYSTEM=hidraw\nE: MAJOR=241\nE: MINOR={}\n"
        "L: device=../../../0003:{}.{:04X}\n\n",
        raw, nodes.hidraw_node, nodes.hidraw_node.substr(11), ids, nodes.address);
    socket.paths.push_back(hid);
    socket.paths.push_back(raw);
  }
  return text;
}

bool UmockdevBus::Impl::attach(Socket& socket) {
  const auto connect = [&](UMockdevIoctlBase* handler) {
    g_signal_connect(handler, "client-connected", G_CALLBACK(on_connected), &socket);
    g_signal_connect(handler, "client-vanished", G_CALLBACK(on_vanished), &socket);
  };
  socket.usb_handler = umockdev_ioctl_base_new();
  connect(socket.usb_handler);
  g_signal_connect(socket.usb_handler, "handle-ioctl", G_CALLBACK(on_usb_ioctl), &socket);
  if (umockdev_testbed_attach_ioctl(testbed_, socket.nodes.usb_node.c_str(), socket.usb_handler,
                                    nullptr) == FALSE) {
    return false;
  }
  if (socket.nodes.hidraw_node.empty()) {
    return true;
  }
  socket.hid_handler = umockdev_ioctl_base_new();
  connect(socket.hid_handler);
  g_signal_connect(socket.hid_handler, "handle-ioctl", G_CALLBACK(on_hid_ioctl), &socket);
  g_signal_connect(socket.hid_handler, "handle-read", G_CALLBACK(on_hid_read), &socket);
  g_signal_connect(socket.hid_handler, "handle-write", G_CALLBACK(on_hid_write), &socket);
  return umockdev_testbed_attach_ioctl(testbed_, socket.nodes.hidraw_node.c_str(),
                                       socket.hid_handler, nullptr) != FALSE;
}

void UmockdevBus::Impl::detach(Socket& socket) {
  for (auto [handler, node] : {std::pair{socket.usb_handler, socket.nodes.usb_node},
                               std::pair{socket.hid_handler, socket.nodes.hidraw_node}}) {
    if (handler != nullptr) {
      umockdev_testbed_detach_ioctl(testbed_, node.c_str(), nullptr);
      g_signal_handlers_disconnect_by_data(handler, &socket);
      g_object_unref(handler);
    }
  }
}

Result<PluggedNodes> UmockdevBus::Impl::plug_in(std::shared_ptr<UsbDevice> device,
                                                std::string port) {
  auto socket = std::make_unique<Socket>();
  SIXPOINT_ASSIGN(socket->configuration, parse_configuration(device->descriptors().configuration));
  Socket& plugged = *socket;
  std::string description;
  {
    const std::lock_guard lock(mutex_);
    for (int number = 1; port.empty(); ++number) {
      const std::string candidate = fmt::format("{}-{}", kBusNumber, number);
      port = sockets_.count(candidate) == 0 ? candidate : "";
    }
    if (sockets_.count(port) != 0) {
      return fail(ErrorCode::usage, "the port is taken", port, "unplug what is there");
    }
    device->plug_in();
    plugged.bus = this;
    plugged.device = std::move(device);
    // What the kernel does with a device that it finds.
    plugged.device->control({0x00, 9, plugged.configuration.value, 0, 0}, {});
    plugged.nodes.port = port;
    plugged.nodes.bus = kBusNumber;
    plugged.nodes.address = next_address_++;
    plugged.nodes.usb_node =
        fmt::format("/dev/bus/usb/{:03}/{:03}", kBusNumber, plugged.nodes.address);
    plugged.usb = std::make_unique<PollNode>(root_ + plugged.nodes.usb_node, false);
    for (const UsbInterface& interface : plugged.configuration.interfaces) {
      if (interface.device_class == kStorageClass) {
        plugged.drivers[interface.number] = "usb-storage";
      }
      if (interface.device_class != kHidClass || plugged.hid) {
        continue;
      }
      plugged.drivers[interface.number] = "usbhid";
      plugged.hid_interface = interface.number;
      for (const UsbEndpoint& endpoint : plugged.configuration.endpoints) {
        if (endpoint.interface == interface.number) {
          ((endpoint.address & 0x80U) != 0 ? plugged.hid_in : plugged.hid_out) = endpoint.address;
        }
      }
      plugged.nodes.hidraw_node = fmt::format("/dev/hidraw{}", next_hidraw_++);
      plugged.hid = std::make_unique<PollNode>(root_ + plugged.nodes.hidraw_node, true);
    }
    if (!plugged.usb->ok() || (plugged.hid && !plugged.hid->ok())) {
      return fail(ErrorCode::io, "cannot make a device node", root_, "is /tmp full?");
    }
    description = describe(plugged, "/devices/pci0000:00/0000:00:14.0/usb1/" + port);
    sockets_[port] = std::move(socket);
  }
  // Without the lock: what follows reaches umockdev's thread and the programs.
  if (!attach(plugged)) {
    return fail(ErrorCode::internal, "umockdev does not take the handlers", port,
                "report this as a defect of the program");
  }
  // Whoever may open a node may talk to its handler.
  for (const std::string& node : {plugged.nodes.usb_node, plugged.nodes.hidraw_node}) {
    ::chmod((root_ + "/ioctl" + node).c_str(), 0777);
  }
  GError* error = nullptr;
  if (umockdev_testbed_add_from_string(testbed_, description.c_str(), &error) == FALSE) {
    const std::string what = error == nullptr ? "" : error->message;
    g_clear_error(&error);
    return fail(ErrorCode::internal, "umockdev does not take the device: " + what, port,
                "report this as a defect of the program");
  }
  return plugged.nodes;
}

void UmockdevBus::Impl::unplug(const std::string& port) {
  Socket* socket = nullptr;
  {
    const std::lock_guard lock(mutex_);
    const auto found = sockets_.find(port);
    if (found == sockets_.end()) {
      return;
    }
    socket = found->second.get();
    socket->device->unplug();
    socket->gone = true;
    for (Urb& urb : socket->pending) {
      finish(*socket, std::move(urb), -ESHUTDOWN);
    }
    socket->pending.clear();
    for (HidWrite& write : socket->hid_writes) {
      umockdev_ioctl_client_complete(write.client.get(), -1, ENODEV);
    }
    socket->hid_writes.clear();
    serve(*socket);
    left_.push_back(std::move(found->second));
    sockets_.erase(found);
  }
  for (auto path = socket->paths.rbegin(); path != socket->paths.rend(); ++path) {
    umockdev_testbed_uevent(testbed_, ("/sys" + *path).c_str(), "remove");
  }
  for (auto path = socket->paths.rbegin(); path != socket->paths.rend(); ++path) {
    umockdev_testbed_remove_device(testbed_, ("/sys" + *path).c_str());
  }
  for (const auto* node : {socket->usb.get(), socket->hid.get()}) {
    if (node != nullptr) {
      ::unlink(node->path().c_str());
    }
  }
}

void UmockdevBus::Impl::allow(const std::string& port, bool allowed) {
  const std::lock_guard lock(mutex_);
  const auto found = sockets_.find(port);
  if (found == sockets_.end()) {
    return;
  }
  for (const auto* node : {found->second->usb.get(), found->second->hid.get()}) {
    if (node != nullptr) {
      ::chmod(node->path().c_str(), allowed ? 0666 : 0);
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
