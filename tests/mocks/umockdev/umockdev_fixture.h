// A bus of umockdev with a unit on it, and its nodes by the system's own calls.
#pragma once

#include <cerrno>
#include <cstring>
#include <memory>
#include <string>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "expect_result.h"
#include "mocks/umockdev/umockdev_bus.h"
#include "usb/bench.h"

namespace sixpoint::tests {

class OpenFile {
 public:
  explicit OpenFile(const std::string& path, int mode = O_RDWR | O_NONBLOCK)
      : fd_(::open(path.c_str(), mode | O_CLOEXEC)) {
    EXPECT_GE(fd_, 0) << path << ": " << std::strerror(errno);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() { close(); }
  void close() {
    if (fd_ >= 0) {
      ::close(fd_);
    }
    fd_ = -1;
  }
  int fd() const { return fd_; }

  // 0 or more as the call answers, or the negative errno.
  template <class Argument>
  int ask(unsigned long request, Argument* argument) const {
    const int answer = ::ioctl(fd_, request, argument);
    return answer < 0 ? -errno : answer;
  }
  int ask(unsigned long request) const { return ask(request, static_cast<void*>(nullptr)); }
  // Whether it becomes ready (POLLIN or POLLOUT) while we wait so long.
  bool is_ready(short events, int wait_ms = 5000) const {
    pollfd one{fd_, events, 0};
    return ::poll(&one, 1, wait_ms) == 1 && (one.revents & events) != 0;
  }

 private:
  int fd_;
};

// A transfer on usbfs.
struct Transfer {
  Transfer(std::uint8_t type, std::uint8_t endpoint, Bytes bytes) : buffer(std::move(bytes)) {
    std::memset(&urb, 0, sizeof(urb));
    urb.type = type;
    urb.endpoint = endpoint;
    urb.buffer = buffer.data();
    urb.buffer_length = static_cast<int>(buffer.size());
  }
  // A control request towards the host: its setup packet, and room for the answer.
  static Bytes control_in(Bytes setup) {
    const std::size_t length = setup.at(6) + 256U * setup.at(7);
    setup.resize(8 + length, 0);
    return setup;
  }
  Bytes received() const { return {buffer.begin() + 8, buffer.begin() + 8 + urb.actual_length}; }

  Bytes buffer;
  usbdevfs_urb urb;
};

// Takes back a transfer that is over: null where there is none, with the reason in errno.
inline usbdevfs_urb* reap(const OpenFile& usb) {
  void* done = nullptr;
  return usb.ask(USBDEVFS_REAPURBNDELAY, &done) < 0 ? nullptr : static_cast<usbdevfs_urb*>(done);
}

class UmockdevTest : public testing::Test {
 protected:
  void SetUp() override {
    auto made = mocks::UmockdevBus::make();
    ASSERT_OK(made);
    bus = std::move(*made);
  }
  // Plugs in the unit.
  mocks::PluggedNodes plug_in() {
    auto nodes = bus->plug_in(unit.device);
    EXPECT_OK(nodes);
    return nodes.value_or(mocks::PluggedNodes{});
  }

  BenchUnit unit = make_unit(7);
  std::unique_ptr<mocks::UmockdevBus> bus;
};

}  // namespace sixpoint::tests
