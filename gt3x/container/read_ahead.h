// Reads a source on a thread of its own, some pieces ahead of who reads here: inflating a log and
// working on its records take about as long, and the usual machine has two cores.
//
//   ReadAhead ahead(std::move(source));
//   SIXPOINT_ASSIGN(const std::size_t count, ahead.read(piece));  // as source->read() would answer
//
// The thread begins with the first read() and ends with the object, also in the middle of the
// source; where the system gives no more threads, the caller's reads. What the source throws in the
// thread is an error of read() (error_of() in base/thrown.h). Memory: kPieces pieces of kPieceSize
// bytes.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include "gt3x/container/byte_source.h"

namespace sixpoint::gt3x {

class ReadAhead final : public ByteSource {
 public:
  static constexpr std::size_t kPieces = 4;
  static constexpr std::size_t kPieceSize = std::size_t{256} * 1024;

  explicit ReadAhead(std::unique_ptr<ByteSource> source) : source_(std::move(source)) {}
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;
  ~ReadAhead() override;

  Result<std::size_t> read(std::span<std::uint8_t> out) override;
  std::optional<std::uint64_t> size() const override { return source_->size(); }

 private:
  struct Piece {
    Bytes bytes;
    std::size_t count = 0;       // filled
    std::optional<Error> error;  // instead of bytes; the last piece
    bool last = false;
  };
  void run();
  void read_pieces();
  Piece fill(Bytes bytes);

  std::unique_ptr<ByteSource> source_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Piece> full_;
  std::deque<Bytes> empty_;
  std::size_t made_ = 0;  // buffers that exist
  bool stop_ = false;
  std::exception_ptr thrown_;  // the thread ended by it, behind what is in full_
  // Of the reading side.
  Piece current_;
  std::size_t taken_ = 0;
  std::thread thread_;
  bool has_no_thread_ = false;
};

}  // namespace sixpoint::gt3x
