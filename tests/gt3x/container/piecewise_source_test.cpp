#include "gt3x/container/piecewise_source.h"

#include <new>

#include <gtest/gtest.h>

#include "base/random.h"
#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

struct InPieces {
  Bytes bytes;
  Bytes stream;
  SyncPoints points;
};

InPieces in_pieces(std::size_t count, std::size_t rest) {
  InPieces made;
  made.points.piece_size = 50'000;
  Random random(count);
  PiecePacker packer;
  for (std::size_t i = 0; i <= count; ++i) {
    Bytes piece(i < count ? made.points.piece_size : rest);
    for (auto& byte : piece) {
      byte = static_cast<std::uint8_t>(random.below(30));
    }
    Bytes packed;
    packer.pack(piece, i < count ? PiecePacker::Place::inner : PiecePacker::Place::last, packed);
    made.bytes.insert(made.bytes.end(), piece.begin(), piece.end());
    made.stream.insert(made.stream.end(), packed.begin(), packed.end());
    made.points.packed_sizes.push_back(static_cast<std::uint32_t>(packed.size()));
  }
  return made;
}

TEST(PiecewiseSource, BytesComeInOrder) {
  for (const std::size_t count : {std::size_t{1}, std::size_t{2}, std::size_t{17}}) {
    const InPieces made = in_pieces(count, 12'345);
    for (const std::size_t step : {std::size_t{977}, std::size_t{1} << 20}) {
      const auto source = unpack_pieces(std::make_unique<MemorySource>(made.stream), made.points,
                                        made.bytes.size());
      EXPECT_EQ(source->size(), made.bytes.size());
      Bytes all;
      Bytes piece(step);
      for (;;) {
        const auto got = source->read(piece);
        ASSERT_OK(got);
        if (*got == 0) {
          break;
        }
        all.insert(all.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(*got));
      }
      EXPECT_EQ(all, made.bytes);
      EXPECT_EQ(source->read(piece).value(), 0U);
    }
  }
}

// As where there is no more memory.
class ThrowingSource final : public ByteSource {
 public:
  explicit ThrowingSource(Bytes bytes) : source_(std::move(bytes)) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (++reads_ > 3) {
      throw std::bad_alloc();
    }
    return source_.read(out);
  }
  std::optional<std::uint64_t> size() const override { return source_.size(); }

 private:
  MemorySource source_;
  int reads_ = 0;
};

TEST(PiecewiseSource, WhatIsThrownIsAnErrorBehindTheBytesBeforeIt) {
  const InPieces made = in_pieces(17, 12'345);
  const auto source =
      unpack_pieces(std::make_unique<ThrowingSource>(made.stream), made.points, made.bytes.size());
  Bytes piece(made.points.piece_size);
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK(source->read(piece));
  }
  EXPECT_FAILS(source->read(piece), ErrorCode::io);
  EXPECT_FAILS(source->read(piece), ErrorCode::io);
}

TEST(PiecewiseSource, MayEndInTheMiddle) {
  const InPieces made = in_pieces(17, 1);
  const auto source =
      unpack_pieces(std::make_unique<MemorySource>(made.stream), made.points, made.bytes.size());
  Bytes piece(10);
  EXPECT_EQ(source->read(piece).value(), 10U);
}

// Where it is and what to do is said by who knows the entry (inflating_source.h).
bool is_bad_data(ByteSource& source) {
  const auto read = read_all(source, 1 << 20);
  return !read && read.error().code == ErrorCode::bad_data;
}

TEST(PiecewiseSource, AnIndexThatIsWrongIsAnError) {
  InPieces made = in_pieces(3, 500);
  ++made.points.packed_sizes[0];
  --made.points.packed_sizes[1];
  const auto moved =
      unpack_pieces(std::make_unique<MemorySource>(made.stream), made.points, made.bytes.size());
  EXPECT_TRUE(is_bad_data(*moved));
  made = in_pieces(3, 500);
  made.stream.pop_back();
  const auto cut =
      unpack_pieces(std::make_unique<MemorySource>(made.stream), made.points, made.bytes.size());
  EXPECT_TRUE(is_bad_data(*cut));
}

// A disk that fails behind some bytes.
class FailingSource final : public ByteSource {
 public:
  FailingSource(Bytes bytes, std::size_t good) : bytes_(std::move(bytes)), good_(good) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (done_ == good_) {
      return fail(ErrorCode::io, "cannot be read", "the disk", "try again");
    }
    const std::size_t count = std::min(out.size(), good_ - done_);
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(done_), count, out.begin());
    done_ += count;
    return count;
  }

 private:
  Bytes bytes_;
  std::size_t good_;
  std::size_t done_ = 0;
};

TEST(PiecewiseSource, AnErrorOfTheDiskComesBehindThePiecesBeforeIt) {
  const InPieces made = in_pieces(17, 500);
  for (const std::size_t whole : {std::size_t{0}, std::size_t{1}, std::size_t{9}}) {
    std::size_t good = 1;  // of the piece that breaks
    for (std::size_t i = 0; i < whole; ++i) {
      good += made.points.packed_sizes[i];
    }
    const auto source = unpack_pieces(std::make_unique<FailingSource>(made.stream, good),
                                      made.points, made.bytes.size());
    Bytes all;
    Bytes piece(1 << 20);
    auto got = source->read(piece);
    while (got && *got > 0) {
      all.insert(all.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(*got));
      got = source->read(piece);
    }
    ASSERT_FALSE(got);
    EXPECT_EQ(got.error().code, ErrorCode::io);
    EXPECT_EQ(got.error().where, "the disk");
    EXPECT_EQ(all, Bytes(made.bytes.begin(),
                         made.bytes.begin() +
                             static_cast<std::ptrdiff_t>(whole * made.points.piece_size)));
    EXPECT_EQ(source->read(piece).error().code, ErrorCode::io) << "and again";
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
