// Packs pieces on several threads; what comes out is in the order in which the pieces went in.
//
//   PackLine line(2, [&](std::span<const std::uint8_t> packed) {
//     stream.insert(stream.end(), packed.begin(), packed.end());
//     return Status{};
//   });
//   SIXPOINT_CHECK(line.put(first, PiecePacker::Place::inner));
//   SIXPOINT_CHECK(line.put(second, PiecePacker::Place::last));
//   SIXPOINT_CHECK(line.finish());
//
// The sink is called on the calling thread. One piece more than there are threads is under way, so
// that no thread waits for the sink. Memory: a piece and its packed bytes for each of them, 2 MB,
// and 1 MB of tables for every thread. One object belongs to one thread.
#pragma once

#include <functional>
#include <future>
#include <span>
#include <vector>

#include "base/result.h"
#include "gt3x/container/piece_packer.h"

namespace sixpoint::gt3x {

class PackLine {
 public:
  using Sink = std::function<Status(std::span<const std::uint8_t>)>;

  // Threads beside the calling one; 1: the calling one packs, and also where the system gives no
  // more threads.
  PackLine(unsigned jobs, Sink sink);
  // Waits for the threads, also where not all was written.
  ~PackLine();
  PackLine(const PackLine&) = delete;
  PackLine& operator=(const PackLine&) = delete;

  // Takes the bytes of `piece` along, and leaves others there, whose memory is used again.
  Status put(Bytes& piece, PiecePacker::Place place);
  Status finish();

 private:
  struct Slot {
    Bytes piece;
    Bytes packed;
    std::shared_future<void> done;
  };
  Status write_oldest();

  Sink sink_;
  std::vector<PiecePacker> packers_;  // in turn, one for each thread
  std::vector<Slot> slots_;           // in turn
  std::size_t begun_ = 0;             // pieces
  std::size_t written_ = 0;
};

}  // namespace sixpoint::gt3x
