#include "device/usb/hid_transport.h"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <hidapi.h>
#include <linux/hidraw.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "device/usb/usb_errors.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;
using std::chrono::steady_clock;

struct Close {
  void operator()(hid_device* handle) const { hid_close(handle); }
};
using Handle = std::unique_ptr<hid_device, Close>;

// hidapi keeps the last error of opening in one place for all threads.
std::mutex& opening() {
  static std::mutex mutex;
  return mutex;
}

// hidapi gives the reason as text only, and hid_open_path() of version 0.13 uses memory that it has
// freed where the node is there and does not answer as hidraw: so the kernel is asked first.
Result<Handle> open_handle(const std::string& node) {
  const auto refuse = [&](int reason) {
    return usb_error(reason, "cannot open the unit's reports", node);
  };
  const int plain = ::open(node.c_str(), O_RDWR | O_CLOEXEC);
  if (plain < 0) {
    return refuse(errno);
  }
  int size = 0;
  Handle handle;
  if (::ioctl(plain, HIDIOCGRDESCSIZE, &size) >= 0) {
    const std::lock_guard lock(opening());
    handle.reset(hid_open_path(node.c_str()));
  }
  ::close(plain);
  if (!handle) {
    return refuse(ENODEV);
  }
  return handle;
}

// What the two threads and the transport share. A thread that hangs in the kernel keeps it alive.
struct Shared {
  std::mutex mutex;
  std::condition_variable changed;
  bool stop = false;
  bool cancelled = false;
  std::optional<Error> gone;  // from then on nothing works
  std::deque<Bytes> received;
  std::optional<Bytes> to_write;  // taken out when it is under way
  bool writing = false;
  bool wrote = false;  // outcome of the last one
  int ended = 0;       // threads
};

void end_thread(Shared& shared) {
  const std::lock_guard lock(shared.mutex);
  ++shared.ended;
  shared.changed.notify_all();
}

void read_reports(const std::shared_ptr<Shared>& shared, Handle handle, const std::string& node,
                  HidTransportOptions options) {
  // One byte more than a report, so that a longer one is found.
  std::array<std::uint8_t, kReportBytes + 1> buffer{};
  for (;;) {
    const int count = hid_read_timeout(handle.get(), buffer.data(), buffer.size(),
                                       static_cast<int>(options.slice.count()));
    const std::lock_guard lock(shared->mutex);
    if (shared->stop) {
      break;
    }
    if (count < 0) {
      shared->gone = usb_error(ENODEV, "the unit does not answer", node).value();
      break;
    }
    if (count > 0 && shared->received.size() < options.waiting_reports) {
      shared->received.emplace_back(buffer.begin(), buffer.begin() + count);
      shared->changed.notify_all();
    }
  }
  handle.reset();
  end_thread(*shared);
}

void write_reports(const std::shared_ptr<Shared>& shared, Handle handle) {
  for (;;) {
    Bytes bytes;
    {
      std::unique_lock lock(shared->mutex);
      shared->changed.wait(lock, [&] { return shared->stop || shared->to_write; });
      if (shared->stop) {
        break;
      }
      bytes = *std::exchange(shared->to_write, std::nullopt);
      shared->writing = true;
    }
    const int count = hid_write(handle.get(), bytes.data(), bytes.size());
    const std::lock_guard lock(shared->mutex);
    shared->writing = false;
    shared->wrote = count == static_cast<int>(bytes.size());
    shared->changed.notify_all();
  }
  handle.reset();
  end_thread(*shared);
}

class HidTransport final : public Transport {
 public:
  HidTransport(std::string node, Handle reader, Handle writer, HidTransportOptions options)
      : node_(std::move(node)), shared_(std::make_shared<Shared>()) {
    threads_[0] = std::thread(read_reports, shared_, std::move(reader), node_, options);
    threads_[1] = std::thread(write_reports, shared_, std::move(writer));
  }

  ~HidTransport() override {
    bool all_ended = false;
    {
      std::unique_lock lock(shared_->mutex);
      shared_->stop = true;
      shared_->changed.notify_all();
      all_ended = shared_->changed.wait_for(lock, std::chrono::milliseconds(50),
                                            [&] { return shared_->ended == 2; });
    }
    for (std::thread& thread : threads_) {
      if (all_ended) {
        thread.join();
      } else {
        thread.detach();  // hangs in the kernel; closes its handle when that lets it go
      }
    }
  }

  Status write(std::span<const std::uint8_t> bytes, nanoseconds time_out) override {
    const auto deadline = steady_clock::now() + time_out;
    std::unique_lock lock(shared_->mutex);
    SIXPOINT_CHECK(alive());
    const auto free = [&] { return over() || (!shared_->writing && !shared_->to_write); };
    if (!shared_->changed.wait_until(lock, deadline, free)) {
      return usb_error(ETIMEDOUT, "cannot send to the unit", node_);
    }
    SIXPOINT_CHECK(alive());
    // Devices without report ids: hidapi wants a zero byte in front and does not send it.
    Bytes report(bytes.size() + 1);
    std::copy(bytes.begin(), bytes.end(), report.begin() + 1);
    shared_->to_write = std::move(report);
    shared_->changed.notify_all();
    if (!shared_->changed.wait_until(lock, deadline, free)) {
      shared_->to_write.reset();  // a write that has not begun must not come late
      return usb_error(ETIMEDOUT, "cannot send to the unit", node_);
    }
    SIXPOINT_CHECK(alive());
    if (shared_->wrote) {
      return {};
    }
    return usb_error(::access(node_.c_str(), F_OK) == 0 ? EIO : ENODEV, "cannot send to the unit",
                     node_);
  }

  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    std::unique_lock lock(shared_->mutex);
    shared_->changed.wait_for(lock, time_out, [&] { return over() || !shared_->received.empty(); });
    if (shared_->cancelled || shared_->received.empty()) {
      SIXPOINT_CHECK(alive());
      return 0;
    }
    const Bytes report = std::move(shared_->received.front());
    shared_->received.pop_front();
    if (report.size() > out.size()) {
      return usb_error(EOVERFLOW, "cannot read from the unit", node_);
    }
    std::copy(report.begin(), report.end(), out.begin());
    return report.size();
  }

  void cancel() override {
    const std::lock_guard lock(shared_->mutex);
    shared_->cancelled = true;
    shared_->changed.notify_all();
  }

 private:
  bool over() const { return shared_->cancelled || shared_->gone; }
  Status alive() const {
    if (shared_->cancelled) {
      return fail(ErrorCode::device_unavailable, "the transfer was cancelled", node_,
                  "open the unit again");
    }
    if (shared_->gone) {
      return fail(*shared_->gone);
    }
    return {};
  }

  std::string node_;
  std::shared_ptr<Shared> shared_;
  std::array<std::thread, 2> threads_;
};

}  // namespace

Result<std::unique_ptr<Transport>> open_hid_transport(const std::string& node,
                                                      HidTransportOptions options) {
  // A handle per thread: hidapi's are not safe for two.
  SIXPOINT_ASSIGN(Handle reader, open_handle(node));
  SIXPOINT_ASSIGN(Handle writer, open_handle(node));
  return std::make_unique<HidTransport>(node, std::move(reader), std::move(writer), options);
}

}  // namespace sixpoint::device
