#include "gt3x/container/piecewise_source.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "base/thrown.h"

namespace sixpoint::gt3x {
namespace {

// One core is for who works on the records. More threads than these wait for it.
constexpr std::size_t kMostThreads = 4;
std::size_t unpacking_threads() {
  return std::clamp<std::size_t>(std::thread::hardware_concurrency(), 2, kMostThreads + 1) - 1;
}

class PiecewiseInflate final : public ByteSource {
 public:
  PiecewiseInflate(std::unique_ptr<ByteSource> packed, SyncPoints points, std::uint64_t size)
      : packed_(std::move(packed)),
        points_(std::move(points)),
        size_(size),
        most_threads_(std::min(points_.packed_sizes.size(), unpacking_threads())),
        slots_(most_threads_ + 2) {}
  PiecewiseInflate(const PiecewiseInflate&) = delete;
  PiecewiseInflate& operator=(const PiecewiseInflate&) = delete;
  ~PiecewiseInflate() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) {
      thread.join();
    }
  }

  std::optional<std::uint64_t> size() const override { return size_; }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const std::size_t count = points_.packed_sizes.size();
    while (threads_.size() < most_threads_) {
      try {
        threads_.emplace_back([this] { run(); });
      } catch (const std::system_error&) {
        most_threads_ = threads_.size();  // the system gives no more: wait_for() does without
      }
    }
    if (current_ == count) {
      return std::size_t{0};
    }
    Slot& slot = slots_[current_ % slots_.size()];
    if (taken_ == 0) {
      wait_for(slot);
    }
    if (slot.thrown) {
      return fail(error_of(slot.thrown));
    }
    SIXPOINT_CHECK(slot.status);
    const std::size_t bytes = std::min(out.size(), slot.piece.size() - taken_);
    std::copy_n(slot.piece.begin() + static_cast<std::ptrdiff_t>(taken_), bytes, out.begin());
    taken_ += bytes;
    if (taken_ == slot.piece.size()) {
      {
        const std::lock_guard lock(mutex_);
        slot.done = false;
        ++current_;
      }
      changed_.notify_all();
      taken_ = 0;
    }
    return bytes;
  }

 private:
  struct Slot {
    Bytes packed;
    Bytes piece;
    Status status;
    std::exception_ptr thrown;
    bool done = false;  // the above are the reader's, until it is at the end of the piece
  };

  // Who waits here unpacks the next pieces meanwhile, as far as nobody else takes them.
  void wait_for(const Slot& slot) {
    for (;;) {
      std::unique_lock turn(turn_, std::try_to_lock);
      {
        std::unique_lock lock(mutex_);
        if (slot.done) {
          return;
        }
        if (!turn || !may_begin()) {
          turn = {};
          changed_.wait(lock, [&] { return slot.done; });
          return;
        }
      }
      unpack_next(std::move(turn));
    }
  }

  // Of each thread: the next piece, again and again.
  void run() {
    for (;;) {
      std::unique_lock turn(turn_);
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return stop_ || all_begun() || may_begin(); });
        if (stop_ || all_begun()) {
          return;
        }
      }
      unpack_next(std::move(turn));
    }
  }

  // Both with `turn_` and `mutex_` held.
  bool all_begun() const { return begun_ == points_.packed_sizes.size(); }
  bool may_begin() const { return !all_begun() && begun_ - current_ < slots_.size(); }

  // The next piece into its slot; others may take the one behind it as soon as its bytes are read.
  void unpack_next(std::unique_lock<std::mutex> turn) {
    const std::size_t number = begun_++;
    Slot& slot = slots_[number % slots_.size()];
    const bool is_read = succeeds(slot, [&] { return read_packed(number, slot.packed); });
    if (!is_read) {
      begun_ = points_.packed_sizes.size();  // what would be read next is not what the index says
    }
    turn.unlock();
    if (is_read) {
      succeeds(slot, [&] { return unpack(number, slot); });
    }
    {
      const std::lock_guard lock(mutex_);
      slot.done = true;
    }
    changed_.notify_all();
  }

  // An exception that left a thread would end the program: it goes to who reads.
  template <class Work>
  static bool succeeds(Slot& slot, const Work& work) {
    try {
      slot.status = work();
      return slot.status.has_value();
    } catch (...) {
      slot.thrown = std::current_exception();
      return false;
    }
  }

  Status read_packed(std::size_t number, Bytes& packed) {
    packed.resize(points_.packed_sizes[number]);
    for (std::size_t filled = 0; filled < packed.size();) {
      SIXPOINT_ASSIGN(const std::size_t more, packed_->read(std::span(packed).subspan(filled)));
      if (more == 0) {
        return fail(ErrorCode::bad_data, "the packed data end too early");
      }
      filled += more;
    }
    return {};
  }

  Status unpack(std::size_t number, Slot& slot) const {
    const bool last = number + 1 == points_.packed_sizes.size();
    const std::uint64_t before = std::uint64_t{points_.piece_size} * number;
    slot.piece.resize(last ? size_ - before : points_.piece_size);
    const auto place = last ? PiecePacker::Place::last : PiecePacker::Place::inner;
    return unpack_piece(slot.packed, place, slot.piece)
               ? Status()
               : fail(ErrorCode::bad_data, "the packed data make no sense");
  }

  std::mutex turn_;  // to take the next piece and read its packed bytes
  std::unique_ptr<ByteSource> packed_;
  std::size_t begun_ = 0;  // pieces

  SyncPoints points_;
  std::uint64_t size_;
  std::size_t most_threads_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;  // in turn
  std::size_t current_ = 0;  // piece that read() is in
  bool stop_ = false;

  std::size_t taken_ = 0;  // bytes of it; of the reading side
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<ByteSource> unpack_pieces(std::unique_ptr<ByteSource> packed, SyncPoints points,
                                          std::uint64_t size) {
  return std::make_unique<PiecewiseInflate>(std::move(packed), std::move(points), size);
}

}  // namespace sixpoint::gt3x
