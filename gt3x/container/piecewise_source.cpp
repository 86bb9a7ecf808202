#include "gt3x/container/piecewise_source.h"

#include <algorithm>
#include <future>
#include <thread>
#include <vector>

namespace sixpoint::gt3x {
namespace {

// More than these wait for the one thread that works on the records.
constexpr unsigned kMostThreads = 4;

class PiecewiseInflate final : public ByteSource {
 public:
  PiecewiseInflate(std::unique_ptr<ByteSource> packed, SyncPoints points, std::uint64_t size)
      : packed_(std::move(packed)),
        points_(std::move(points)),
        size_(size),
        slots_(std::clamp(std::thread::hardware_concurrency(), 1U, kMostThreads) + 1) {}

  std::optional<std::uint64_t> size() const override { return size_; }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const std::size_t count = points_.packed_sizes.size();
    while (begun_ < count && begun_ - current_ < slots_.size()) {
      SIXPOINT_CHECK(begin_next());
    }
    if (current_ == count) {
      return std::size_t{0};
    }
    Slot& slot = slots_[current_ % slots_.size()];
    if (slot.done.valid() && !slot.done.get()) {
      return fail(ErrorCode::bad_data, "the packed data make no sense");
    }
    const std::size_t bytes = std::min(out.size(), slot.piece.size() - taken_);
    std::copy_n(slot.piece.begin() + static_cast<std::ptrdiff_t>(taken_), bytes, out.begin());
    taken_ += bytes;
    if (taken_ == slot.piece.size()) {
      ++current_;
      taken_ = 0;
    }
    return bytes;
  }

 private:
  struct Slot {
    Bytes packed;
    Bytes piece;
    std::future<bool> done;  // its end waits for the thread that uses the above
  };

  Status begin_next() {
    Slot& slot = slots_[begun_ % slots_.size()];
    slot.packed.resize(points_.packed_sizes[begun_]);
    for (std::size_t filled = 0; filled < slot.packed.size();) {
      SIXPOINT_ASSIGN(const std::size_t more,
                      packed_->read(std::span(slot.packed).subspan(filled)));
      if (more == 0) {
        return fail(ErrorCode::bad_data, "the packed data end too early");
      }
      filled += more;
    }
    const bool last = begun_ + 1 == points_.packed_sizes.size();
    const std::uint64_t before = std::uint64_t{points_.piece_size} * begun_;
    slot.piece.resize(last ? size_ - before : points_.piece_size);
    const auto place = last ? PiecePacker::Place::last : PiecePacker::Place::inner;
    slot.done = std::async(std::launch::async,
                           [&slot, place] { return unpack_piece(slot.packed, place, slot.piece); });
    ++begun_;
    return {};
  }

  std::unique_ptr<ByteSource> packed_;
  SyncPoints points_;
  std::uint64_t size_;
  std::vector<Slot> slots_;  // in turn
  std::size_t begun_ = 0;    // pieces
  std::size_t current_ = 0;  // piece that read() is in
  std::size_t taken_ = 0;    // bytes of it
};

}  // namespace

std::unique_ptr<ByteSource> unpack_pieces(std::unique_ptr<ByteSource> packed, SyncPoints points,
                                          std::uint64_t size) {
  return std::make_unique<PiecewiseInflate>(std::move(packed), std::move(points), size);
}

}  // namespace sixpoint::gt3x
