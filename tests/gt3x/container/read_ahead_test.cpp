#include "gt3x/container/read_ahead.h"

#include <atomic>
#include <new>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

// Bytes 0, 1, 2 ... modulo 251, then the end or an error.
class Counting final : public ByteSource {
 public:
  Counting(std::size_t size, bool fails, std::atomic<std::size_t>& read)
      : size_(size), fails_(fails), read_(read) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (at_ == size_ && fails_) {
      return fail(ErrorCode::io, "the disk is gone", "f", "look for it");
    }
    const std::size_t count = std::min({out.size(), size_ - at_, std::size_t{10'007}});
    for (std::size_t i = 0; i < count; ++i) {
      out[i] = static_cast<std::uint8_t>((at_ + i) % 251);
    }
    at_ += count;
    read_ = at_;
    return count;
  }
  std::optional<std::uint64_t> size() const override { return size_; }

 private:
  std::size_t size_;
  bool fails_;
  std::atomic<std::size_t>& read_;
  std::size_t at_ = 0;
};

class ReadAheadTest : public testing::Test {
 protected:
  ReadAhead ahead(std::size_t size, bool fails = false) {
    return ReadAhead(std::make_unique<Counting>(size, fails, read_));
  }
  std::atomic<std::size_t> read_ = 0;
};

TEST_F(ReadAheadTest, GivesTheSameBytesWhateverTheSize) {
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, ReadAhead::kPieceSize, 9 * ReadAhead::kPieceSize + 1}) {
    ReadAhead source = ahead(size);
    EXPECT_EQ(source.size(), size);
    const Bytes bytes = read_all(source, 1U << 30).value();
    ASSERT_EQ(bytes.size(), size);
    for (std::size_t i = 0; i < size; ++i) {
      ASSERT_EQ(bytes[i], i % 251);
    }
    Bytes piece(10);
    EXPECT_EQ(source.read(piece).value(), 0U) << "the end stays the end";
  }
}

TEST_F(ReadAheadTest, AnErrorComesBehindTheBytesBeforeItAndStays) {
  ReadAhead source = ahead(ReadAhead::kPieceSize + 5, true);
  Bytes piece(ReadAhead::kPieceSize);
  std::size_t got = 0;
  for (;;) {
    const auto count = source.read(piece);
    if (!count) {
      EXPECT_EQ(count.error().code, ErrorCode::io);
      break;
    }
    got += *count;
  }
  EXPECT_EQ(got, ReadAhead::kPieceSize + 5);
  EXPECT_FAILS(source.read(piece), ErrorCode::io);
}

// As where there is no more memory.
class ThrowingReads final : public ByteSource {
 public:
  Result<std::size_t> read(std::span<std::uint8_t> /*out*/) override {
    if (++reads_ > 2) {
      throw std::bad_alloc();
    }
    return std::size_t{100};
  }
  std::optional<std::uint64_t> size() const override { return std::nullopt; }

 private:
  int reads_ = 0;
};

TEST_F(ReadAheadTest, WhatTheSourceThrowsIsAnErrorAndStays) {
  ReadAhead source(std::make_unique<ThrowingReads>());
  Bytes piece(1000);
  EXPECT_FAILS(source.read(piece), ErrorCode::io);
  EXPECT_FAILS(source.read(piece), ErrorCode::io);
}

TEST_F(ReadAheadTest, MayEndAtAnyTimeAndIsNeverFarAhead) {
  { const ReadAhead never_read = ahead(1U << 30); }
  EXPECT_EQ(read_, 0U);
  {
    ReadAhead source = ahead(1U << 30);
    Bytes piece(1);
    ASSERT_OK(source.read(piece));
  }
  EXPECT_LE(read_, (ReadAhead::kPieces + 1) * ReadAhead::kPieceSize);
}

}  // namespace
}  // namespace sixpoint::gt3x
