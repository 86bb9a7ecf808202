#include "device/usb/bulk_transport.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <deque>
#include <list>
#include <mutex>
#include <thread>
#include <vector>

#include <libusb.h>

#include "device/usb/usb_errors.h"
#include "device/usb/usb_ids.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;

// Whole packets of both speeds, so that a device cannot overrun a transfer that has room for it.
constexpr std::size_t kTransferBytes = (kBulkBlockBytes + 511) / 512 * 512;

int errno_of(int libusb_code) {
  constexpr std::array<std::pair<int, int>, 8> kErrors = {{{LIBUSB_ERROR_ACCESS, EACCES},
                                                           {LIBUSB_ERROR_BUSY, EBUSY},
                                                           {LIBUSB_ERROR_NO_DEVICE, ENODEV},
                                                           {LIBUSB_ERROR_NOT_FOUND, ENODEV},
                                                           {LIBUSB_ERROR_PIPE, EPIPE},
                                                           {LIBUSB_ERROR_TIMEOUT, ETIMEDOUT},
                                                           {LIBUSB_ERROR_OVERFLOW, EOVERFLOW},
                                                           {LIBUSB_ERROR_NO_MEM, ENOMEM}}};
  for (const auto& [code, number] : kErrors) {
    if (code == libusb_code) {
      return number;
    }
  }
  return EIO;
}

int errno_of(libusb_transfer_status status) {
  // In the order of the enumeration: completed, error, timed out, cancelled, stall, no device,
  // overflow.
  constexpr std::array<int, 7> kErrors = {0, EIO, ETIMEDOUT, ECANCELED, EPIPE, ENODEV, EOVERFLOW};
  return status < kErrors.size() ? kErrors[status] : EIO;
}

class BulkTransport;

// A transfer and its buffer. Owned by the transport; never freed while libusb has it.
struct Slot {
  explicit Slot(BulkTransport& transport, std::size_t bytes)
      : owner(transport), buffer(bytes), transfer(libusb_alloc_transfer(0)) {}
  ~Slot() { libusb_free_transfer(transfer); }
  Slot(const Slot&) = delete;
  Slot& operator=(const Slot&) = delete;

  BulkTransport& owner;
  Bytes buffer;
  libusb_transfer* transfer;
  bool under_way = false;
  int error = 0;  // errno of the finished one
};

class BulkTransport final : public Transport {
 public:
  BulkTransport(libusb_context* context, std::string node, BulkTransportOptions options)
      : context_(context), node_(std::move(node)), options_(options) {}

  Status claim(UsbLocation location) {
    constexpr const char* kWhat = "cannot open the unit's bulk interface";
    libusb_device** list = nullptr;
    const ssize_t count = libusb_get_device_list(context_, &list);
    int code = LIBUSB_ERROR_NO_DEVICE;
    for (ssize_t i = 0; i < count; ++i) {
      if (libusb_get_bus_number(list[i]) == location.bus &&
          libusb_get_device_address(list[i]) == location.address) {
        code = libusb_open(list[i], &handle_);
        break;
      }
    }
    if (count >= 0) {
      libusb_free_device_list(list, 1);
    }
    if (code != LIBUSB_SUCCESS) {
      return usb_error(errno_of(code), kWhat, node_);
    }
    code = libusb_claim_interface(handle_, kBulkInterface);
    if (code == LIBUSB_ERROR_NOT_FOUND) {
      return fail(ErrorCode::bad_data, "the device has no bulk interface", node_,
                  "update the unit's firmware; is it a unit of this kind?");
    }
    if (code != LIBUSB_SUCCESS) {
      return usb_error(errno_of(code), kWhat, node_);
    }
    claimed_ = true;
    return {};
  }

  ~BulkTransport() override {
    if (thread_.joinable()) {
      {
        std::unique_lock lock(mutex_);
        cancel_transfers();
        // The kernel gives cancelled transfers back at once, or the device is gone and it does too.
        changed_.wait_for(lock, std::chrono::milliseconds(40), [&] { return under_way() == 0; });
      }
      finished_ = true;
      libusb_interrupt_event_handler(context_);
      thread_.join();
    }
    if (claimed_) {
      libusb_release_interface(handle_, kBulkInterface);
    }
    if (handle_ != nullptr) {
      libusb_close(handle_);  // takes back what a device that hangs still had
    }
    for (auto* list : {&incoming_, &outgoing_}) {
      for (Slot& slot : *list) {
        slot.transfer->dev_handle = nullptr;  // libusb_free_transfer() would read it
      }
      list->clear();
    }
    libusb_exit(context_);
  }

  Status write(std::span<const std::uint8_t> bytes, nanoseconds time_out) override {
    std::unique_lock lock(mutex_);
    SIXPOINT_CHECK(alive());
    start_thread();
    outgoing_.remove_if([](const Slot& earlier) { return !earlier.under_way; });
    outgoing_.emplace_back(*this, std::max<std::size_t>(bytes.size(), 1));
    Slot& slot = outgoing_.back();
    std::copy(bytes.begin(), bytes.end(), slot.buffer.begin());
    const int code = submit(slot, kBulkOutEndpoint, bytes.size());
    if (code != LIBUSB_SUCCESS) {
      outgoing_.pop_back();
      return usb_error(errno_of(code), "cannot send to the unit", node_);
    }
    if (!changed_.wait_for(lock, time_out, [&] { return !slot.under_way || cancelled_; })) {
      libusb_cancel_transfer(slot.transfer);
      changed_.wait_for(lock, std::chrono::milliseconds(50), [&] { return !slot.under_way; });
    }
    SIXPOINT_CHECK(alive());
    if (slot.under_way) {
      return usb_error(ETIMEDOUT, "cannot send to the unit", node_);  // stays in the list for now
    }
    const int error = slot.error == ECANCELED ? ETIMEDOUT : slot.error;
    const bool all = static_cast<std::size_t>(slot.transfer->actual_length) == bytes.size();
    outgoing_.pop_back();
    if (error == 0 && all) {
      return {};
    }
    return usb_error(error == 0 ? ETIMEDOUT : error, "cannot send to the unit", node_);
  }

  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    std::unique_lock lock(mutex_);
    SIXPOINT_CHECK(alive());
    SIXPOINT_CHECK(read_ahead());
    changed_.wait_for(lock, time_out, [&] { return cancelled_ || !done_.empty(); });
    SIXPOINT_CHECK(alive());
    if (done_.empty()) {
      return 0;
    }
    Slot& slot = *done_.front();
    done_.pop_front();
    if (slot.error != 0) {
      const int error = slot.error;
      if (error == EPIPE) {
        clear_halt(lock);
      }
      return usb_error(error, "cannot read from the unit", node_);
    }
    const auto count = static_cast<std::size_t>(slot.transfer->actual_length);
    if (count > out.size()) {
      static_cast<void>(submit(slot, kBulkInEndpoint, slot.buffer.size()));
      return usb_error(EOVERFLOW, "cannot read from the unit", node_);
    }
    std::copy_n(slot.buffer.begin(), count, out.begin());
    // Under way again at once; if that fails the next read() finds it out.
    static_cast<void>(submit(slot, kBulkInEndpoint, slot.buffer.size()));
    return count;
  }

  void cancel() override {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    cancel_transfers();
    changed_.notify_all();
  }

 private:
  static void LIBUSB_CALL finished(libusb_transfer* transfer) {
    auto& slot = *static_cast<Slot*>(transfer->user_data);
    BulkTransport& self = slot.owner;
    const std::lock_guard lock(self.mutex_);
    slot.under_way = false;
    slot.error = errno_of(transfer->status);
    const bool incoming = transfer->endpoint == kBulkInEndpoint;
    // Cancelled ones carry nothing: they lie idle until the next read().
    if (incoming && slot.error != ECANCELED) {
      self.done_.push_back(&slot);
    }
    self.changed_.notify_all();
  }

  int submit(Slot& slot, std::uint8_t endpoint, std::size_t bytes) {
    libusb_fill_bulk_transfer(slot.transfer, handle_, endpoint, slot.buffer.data(),
                              static_cast<int>(bytes), finished, &slot, 0);
    slot.error = 0;
    slot.under_way = true;
    const int code = libusb_submit_transfer(slot.transfer);
    slot.under_way = code == LIBUSB_SUCCESS;
    return code;
  }

  void start_thread() {
    if (thread_.joinable()) {
      return;
    }
    thread_ = std::thread([this] {
      while (!finished_) {
        timeval patience{0, 50'000};
        libusb_handle_events_timeout_completed(context_, &patience, nullptr);
      }
    });
  }

  // Puts every idle transfer under way. The caller holds the mutex.
  Status read_ahead() {
    start_thread();
    while (incoming_.size() < static_cast<std::size_t>(std::max(options_.transfers, 1))) {
      incoming_.emplace_back(*this, kTransferBytes);
    }
    for (Slot& slot : incoming_) {
      const bool waits = std::find(done_.begin(), done_.end(), &slot) != done_.end();
      if (slot.under_way || waits) {
        continue;
      }
      if (const int code = submit(slot, kBulkInEndpoint, slot.buffer.size());
          code != LIBUSB_SUCCESS) {
        if (!done_.empty() || under_way() > 0) {
          break;  // what came before it is delivered first
        }
        return usb_error(errno_of(code), "cannot read from the unit", node_);
      }
    }
    return {};
  }

  // The halt is cleared when no transfer is under way any more; then all start again.
  void clear_halt(std::unique_lock<std::mutex>& lock) {
    cancel_transfers();
    changed_.wait_for(lock, std::chrono::milliseconds(80), [&] { return under_way() == 0; });
    done_.clear();
    lock.unlock();
    libusb_clear_halt(handle_, kBulkInEndpoint);
    lock.lock();
  }

  void cancel_transfers() {
    for (auto* list : {&incoming_, &outgoing_}) {
      for (Slot& slot : *list) {
        if (slot.under_way) {
          libusb_cancel_transfer(slot.transfer);
        }
      }
    }
  }

  int under_way() const {
    int count = 0;
    for (const auto* list : {&incoming_, &outgoing_}) {
      count += static_cast<int>(
          std::count_if(list->begin(), list->end(), [](const Slot& s) { return s.under_way; }));
    }
    return count;
  }

  Status alive() const {
    if (cancelled_) {
      return fail(ErrorCode::device_unavailable, "the transfer was cancelled", node_,
                  "open the unit again");
    }
    return {};
  }

  libusb_context* context_;
  std::string node_;
  BulkTransportOptions options_;
  libusb_device_handle* handle_ = nullptr;
  bool claimed_ = false;
  std::thread thread_;
  std::atomic<bool> finished_ = false;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::list<Slot> incoming_;
  std::list<Slot> outgoing_;
  std::deque<Slot*> done_;  // in the order in which they came
  bool cancelled_ = false;
};

}  // namespace

Result<std::unique_ptr<Transport>> open_bulk_transport(UsbLocation location,
                                                       const std::string& node,
                                                       BulkTransportOptions options) {
  // A context of its own: no unit's events wait for another's.
  libusb_context* context = nullptr;
  if (const int code = libusb_init(&context); code != LIBUSB_SUCCESS) {
    return usb_error(errno_of(code), "libusb does not start", node);
  }
  auto transport = std::make_unique<BulkTransport>(context, node, options);
  SIXPOINT_CHECK(transport->claim(location));
  return transport;
}

}  // namespace sixpoint::device
