#include "gt3x/container/read_ahead.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "base/thrown.h"

namespace sixpoint::gt3x {

ReadAhead::~ReadAhead() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) {
    thread_.join();
  }
}

ReadAhead::Piece ReadAhead::fill(Bytes bytes) {
  Piece piece;
  piece.bytes = std::move(bytes);
  piece.bytes.resize(kPieceSize);
  while (piece.count < kPieceSize) {
    auto count = source_->read(std::span(piece.bytes).subspan(piece.count));
    if (!count) {
      piece.error = std::move(count).error();
      piece.last = true;
      break;
    }
    if (*count == 0) {
      piece.last = true;
      break;
    }
    piece.count += *count;
  }
  return piece;
}

void ReadAhead::run() {
  try {
    read_pieces();
  } catch (...) {  // an exception that left the thread would end the program
    {
      const std::lock_guard lock(mutex_);
      thrown_ = std::current_exception();
    }
    changed_.notify_all();
  }
}

void ReadAhead::read_pieces() {
  for (;;) {
    Bytes buffer;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stop_ || !empty_.empty() || made_ < kPieces; });
      if (stop_) {
        return;
      }
      if (empty_.empty()) {
        ++made_;
      } else {
        buffer = std::move(empty_.front());
        empty_.pop_front();
      }
    }
    Piece piece = fill(std::move(buffer));
    const bool last = piece.last;
    {
      const std::lock_guard lock(mutex_);
      full_.push_back(std::move(piece));
    }
    changed_.notify_all();
    if (last) {
      return;
    }
  }
}

Result<std::size_t> ReadAhead::read(std::span<std::uint8_t> out) {
  if (!thread_.joinable() && !has_no_thread_) {
    try {
      thread_ = std::thread([this] { run(); });
    } catch (const std::system_error&) {
      has_no_thread_ = true;  // the system gives no more
    }
  }
  if (has_no_thread_) {
    return source_->read(out);
  }
  while (taken_ == current_.count) {
    if (current_.last) {
      // Bytes before an error are handed out first, as the source would have done.
      return current_.error ? Result<std::size_t>(fail(*current_.error)) : std::size_t{0};
    }
    std::unique_lock lock(mutex_);
    if (!current_.bytes.empty()) {
      empty_.push_back(std::move(current_.bytes));
      current_.bytes.clear();
      changed_.notify_all();
    }
    changed_.wait(lock, [&] { return !full_.empty() || thrown_; });
    if (full_.empty()) {
      return fail(error_of(thrown_));
    }
    current_ = std::move(full_.front());
    full_.pop_front();
    taken_ = 0;
  }
  const std::size_t count = std::min(out.size(), current_.count - taken_);
  std::copy_n(current_.bytes.begin() + static_cast<std::ptrdiff_t>(taken_), count, out.begin());
  taken_ += count;
  return count;
}

}  // namespace sixpoint::gt3x
