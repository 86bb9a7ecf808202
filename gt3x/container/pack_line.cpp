#include "gt3x/container/pack_line.h"

#include <algorithm>
#include <exception>
#include <system_error>
#include <utility>

#include "base/thrown.h"

namespace sixpoint::gt3x {

PackLine::PackLine(unsigned jobs, Sink sink)
    : sink_(std::move(sink)), packers_(std::max(jobs, 1U)), slots_(jobs > 1 ? jobs + 1 : 1U) {}

PackLine::~PackLine() {
  for (const Slot& slot : slots_) {
    if (slot.done.valid()) {
      slot.done.wait();
    }
  }
}

Status PackLine::write_oldest() {
  Slot& slot = slots_[written_++ % slots_.size()];
  if (slot.done.valid()) {
    try {
      slot.done.get();
    } catch (const std::exception& exception) {
      return fail(error_of(exception));
    }
  }
  return sink_(slot.packed);
}

Status PackLine::put(Bytes& piece, PiecePacker::Place place) {
  if (begun_ - written_ == slots_.size()) {
    SIXPOINT_CHECK(write_oldest());
  }
  Slot& slot = slots_[begun_ % slots_.size()];
  PiecePacker& packer = packers_[begun_ % packers_.size()];
  slot.piece.swap(piece);
  if (packers_.size() == 1) {
    packer.pack(slot.piece, place, slot.packed);
  } else {
    std::shared_future<void> before;  // the packer's last piece
    if (begun_ >= packers_.size()) {
      before = slots_[(begun_ - packers_.size()) % slots_.size()].done;
    }
    auto pack = [&slot, &packer, place, before]() mutable {
      if (before.valid()) {
        before.wait();
        before = {};  // else each piece would keep all before it
      }
      packer.pack(slot.piece, place, slot.packed);
    };
    try {
      slot.done = std::async(std::launch::async, pack);
    } catch (const std::system_error&) {  // the system gives no more threads
      slot.done = {};
      pack();
    }
  }
  ++begun_;
  return {};
}

Status PackLine::finish() {
  while (written_ < begun_) {
    SIXPOINT_CHECK(write_oldest());
  }
  return {};
}

}  // namespace sixpoint::gt3x
