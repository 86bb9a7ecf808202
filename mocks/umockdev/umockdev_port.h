// A device in a port of the umockdev bus, and what programs have under way with it.
//
// Internal to the umockdev carrier: umockdev_bus.cpp plugs ports in and out, umockdev_port.cpp
// serves them, umockdev_usbfs.cpp and umockdev_hidraw.cpp answer the system calls of the two nodes
// as Linux 6.1 does, umockdev_sysfs.cpp describes the device to udev.
//
// All handlers of a process run in umockdev's one thread: they never wait. The bus' mutex guards a
// port; every function but attach() and detach() is called with it held.
#pragma once

#include <condition_variable>
#include <deque>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include <linux/usbdevice_fs.h>

#include "mocks/umockdev/plugged_nodes.h"
#include "mocks/umockdev/umockdev_client.h"
#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

using std::chrono::nanoseconds;

// What the ports of a bus share: its mutex, and the condition that makes it serve them again.
struct UmockdevShared {
  std::mutex mutex;
  std::condition_variable wake;
};

class UmockdevPort {
 public:
  // `nodes` without hidraw_node. Configures the device, as the kernel does with a new one.
  UmockdevPort(UmockdevShared& shared, std::shared_ptr<UsbDevice> device,
               UsbConfiguration configuration, PluggedNodes nodes);

  // The class of its HID interface has a node of its own; `hidraw` becomes its number.
  bool has_hid() const { return hid_interface_.has_value(); }
  void set_hidraw(int hidraw);
  // Makes the nodes below `root`; false when that fails.
  bool make_nodes(const std::string& root);
  // The device, its interfaces, its HID device and its hidraw node in sysfs under `path`, in
  // umockdev's text form.
  std::string describe(const std::string& path);
  bool attach(UMockdevTestbed* testbed);
  void detach(UMockdevTestbed* testbed);

  // Carries out what the device has an answer for.
  void serve();
  // How long the bus may wait before it serves again; none: until the next system call.
  std::optional<nanoseconds> wait_time() const;
  // The device has left: pending transfers fail as in the kernel.
  void unplug();

  UsbDevice& device() { return *device_; }
  const PluggedNodes& nodes() const { return nodes_; }
  const std::vector<std::string>& paths() const { return paths_; }  // in sysfs, parents first
  std::vector<std::string> node_files() const;

 private:
  struct Urb {
    UMockdevIoctlClient* client = nullptr;  // who submitted it; only compared
    std::uint64_t address = 0;              // of the structure in the client
    ClientData data;                        // the structure
    ClientData buffer;                      // may be null when empty
    std::uint8_t type = 0;
    std::uint8_t endpoint = 0;
    int buffer_length = 0;
    int status = 0;
    Bytes received;
    int actual_length = 0;
  };
  struct HidWrite {
    ClientReference client;
    Bytes report;
    nanoseconds deadline;
    std::size_t count = 0;
  };
  // Result and errno of a system call.
  struct CallResult {
    long value = -1;
    int error = 0;
  };

  // Calls `answer` (a member function) with the mutex held and completes the system call.
  template <auto kAnswer>
  static gboolean on_call(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer port);
  static void on_connected(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer port);

  void forget_closed_files();
  bool carry_out(Urb& urb);
  void finish(Urb urb, int status);
  void serve_urbs();
  void serve_hid_writes();
  void serve_hid_reads();
  UsbAnswer clear_halt(std::uint16_t endpoint);

  // Empty: the call is completed later.
  std::optional<CallResult> usb_ioctl(UMockdevIoctlClient* client);
  std::optional<CallResult> hid_ioctl(UMockdevIoctlClient* client);
  std::optional<CallResult> hid_read(UMockdevIoctlClient* client);
  std::optional<CallResult> hid_write(UMockdevIoctlClient* client);

  // Each returns an errno, 0 for success.
  int usbfs(UMockdevIoctlClient* client, gulong request, ClientData target);
  int claim(UMockdevIoctlClient* client, unsigned interface);
  int release(UMockdevIoctlClient* client, unsigned interface);
  int submit(UMockdevIoctlClient* client, ClientData data);
  int discard(UMockdevIoctlClient* client, std::uint64_t address);
  int reap(UMockdevIoctlClient* client, UMockdevIoctlData* pointer);
  int get_driver(UMockdevIoctlData* target) const;
  int driver_ioctl(UMockdevIoctlClient* client, const usbdevfs_ioctl& command);
  void bind_driver(const UsbInterface& interface);

  UmockdevShared& shared_;
  std::shared_ptr<UsbDevice> device_;
  UsbConfiguration configuration_;
  PluggedNodes nodes_;
  std::vector<std::string> paths_;
  std::unique_ptr<PollNode> usb_;
  std::unique_ptr<PollNode> hid_;
  UMockdevIoctlBase* usb_handler_ = nullptr;
  UMockdevIoctlBase* hid_handler_ = nullptr;
  std::optional<std::uint8_t> hid_interface_;
  std::uint8_t hid_in_ = 0;
  std::uint8_t hid_out_ = 0;
  bool gone_ = false;
  // By interface: the client that claimed it, or the kernel's driver.
  std::map<std::uint8_t, UMockdevIoctlClient*> claimed_;
  std::map<std::uint8_t, std::string> drivers_;
  std::deque<Urb> pending_;
  std::deque<Urb> reapable_;
  std::map<UMockdevIoctlClient*, ClientReference> clients_;  // with a node open, or until lately
  std::set<UMockdevIoctlClient*> readers_;                   // of the hidraw node
  std::deque<Bytes> reports_;
  std::list<HidWrite> hid_writes_;
  nanoseconds stalled_until_{0};
};

}  // namespace sixpoint::mocks
