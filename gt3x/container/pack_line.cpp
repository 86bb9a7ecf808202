#include "gt3x/container/pack_line.h"

#include <utility>

namespace sixpoint::gt3x {

PackLine::PackLine(unsigned jobs, Sink sink)
    : on_threads_(jobs > 1), sink_(std::move(sink)), slots_(on_threads_ ? jobs : 1U) {}

Status PackLine::write_oldest() {
  Slot& slot = slots_[written_++ % slots_.size()];
  if (slot.done.valid()) {
    slot.done.get();
  }
  return sink_(slot.packed);
}

Status PackLine::put(Bytes& piece, PiecePacker::Place place) {
  if (begun_ - written_ == slots_.size()) {
    SIXPOINT_CHECK(write_oldest());
  }
  Slot& slot = slots_[begun_++ % slots_.size()];
  slot.piece.swap(piece);
  const auto pack = [&slot, place] { slot.packer.pack(slot.piece, place, slot.packed); };
  if (on_threads_) {
    slot.done = std::async(std::launch::async, pack);
  } else {
    pack();
  }
  return {};
}

Status PackLine::finish() {
  while (written_ < begun_) {
    SIXPOINT_CHECK(write_oldest());
  }
  return {};
}

}  // namespace sixpoint::gt3x
