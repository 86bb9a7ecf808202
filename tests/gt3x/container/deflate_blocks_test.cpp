#include "gt3x/container/deflate_blocks.h"

#include <gtest/gtest.h>
#include <libdeflate.h>
#include <zlib.h>

#include "base/bytes.h"
#include "base/random.h"

namespace sixpoint::gt3x {
namespace {

struct Packed {
  Bytes stream;
  Bytes bytes;
};

std::optional<LastBlock> find_in(std::span<const std::uint8_t> stream, const Bytes& bytes) {
  return LastBlockFinder().find(stream, bytes);
}

// The kinds of bytes change, which makes several blocks.
Bytes changing_bytes(std::size_t size, std::uint64_t seed) {
  Random random(seed);
  Bytes bytes;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint64_t kinds = 1 + (i / 30'000 * 97 + seed) % 256;
    bytes.push_back(static_cast<std::uint8_t>(random.below(kinds)));
  }
  return bytes;
}

Packed packed_by_zlib(std::size_t size, int level, int strategy, std::uint64_t seed) {
  Packed made;
  made.bytes = changing_bytes(size, seed);
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, level, Z_DEFLATED, -15, 9, strategy), Z_OK);
  made.stream.resize(deflateBound(&stream, size) + 100);
  stream.next_in = made.bytes.data();
  stream.avail_in = static_cast<uInt>(size);
  stream.next_out = made.stream.data();
  stream.avail_out = static_cast<uInt>(made.stream.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  made.stream.resize(stream.total_out);
  deflateEnd(&stream);
  return made;
}

// Oracle: zlib's inflate from the front, which stops at the end of every block and says how many
// bits are left.
LastBlock last_block_by_zlib(Packed& packed) {
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, -15), Z_OK);
  Bytes out(packed.bytes.size() + 1);
  stream.next_in = packed.stream.data();
  stream.avail_in = static_cast<uInt>(packed.stream.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  LastBlock found;
  for (;;) {
    const int answer = inflate(&stream, Z_BLOCK);
    const auto left = static_cast<unsigned>(stream.data_type & 7);
    const std::uint64_t bit = std::uint64_t{stream.total_in} * 8 - left;
    const bool block_ended = (stream.data_type & 128) != 0;
    const bool in_last = (stream.data_type & 64) != 0;
    if (answer == Z_STREAM_END || (block_ended && in_last)) {
      found.end_bit = bit;
      inflateEnd(&stream);
      return found;
    }
    EXPECT_EQ(answer, Z_OK);
    if (block_ended) {
      found.begin_bit = bit;
    }
  }
}

TEST(DeflateBlocks, TheLastBlockIsWhereZlibFindsIt) {
  int several = 0;
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{500}, std::size_t{200'000}}) {
    for (const int strategy : {Z_DEFAULT_STRATEGY, Z_FIXED, Z_HUFFMAN_ONLY, Z_RLE}) {
      for (const int level : {0, 1, 6, 9}) {
        Packed packed = packed_by_zlib(size, level, strategy, size + 7);
        const LastBlock wanted = last_block_by_zlib(packed);
        const auto found = find_in(packed.stream, packed.bytes);
        ASSERT_TRUE(found) << size << " " << strategy << " " << level;
        EXPECT_EQ(found->begin_bit, wanted.begin_bit) << size << " " << strategy << " " << level;
        EXPECT_EQ(found->end_bit, wanted.end_bit) << size << " " << strategy << " " << level;
        several += found->begin_bit > 0 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(several, 5) << "streams of one block prove little";
}

// What is joined in earnest. One finder for all, as a packer has it.
TEST(DeflateBlocks, TheLastBlockOfLibdeflatesStreams) {
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> packer(
      libdeflate_alloc_compressor(6), &libdeflate_free_compressor);
  LastBlockFinder finder;
  int several = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    Packed packed;
    packed.bytes = changing_bytes(1000 + seed * 45'000, seed * 11);
    if (seed % 4 == 1) {  // one kind of bytes: blocks as long as they get
      std::fill(packed.bytes.begin(), packed.bytes.end(), std::uint8_t{7});
    }
    packed.stream.resize(libdeflate_deflate_compress_bound(packer.get(), packed.bytes.size()));
    packed.stream.resize(libdeflate_deflate_compress(packer.get(), packed.bytes.data(),
                                                     packed.bytes.size(), packed.stream.data(),
                                                     packed.stream.size()));
    const LastBlock wanted = last_block_by_zlib(packed);
    const auto found = finder.find(packed.stream, packed.bytes);
    ASSERT_TRUE(found) << seed;
    EXPECT_EQ(found->begin_bit, wanted.begin_bit) << seed;
    EXPECT_EQ(found->end_bit, wanted.end_bit) << seed;
    several += found->begin_bit > 0 ? 1 : 0;
  }
  EXPECT_GT(several, 12) << "streams of one block prove little";
}

// Bytes that are no longer those of the stream show no agreement; the stream is read from the
// front.
TEST(DeflateBlocks, ADifferenceIsNoAgreement) {
  Packed packed = packed_by_zlib(200'000, 6, Z_DEFAULT_STRATEGY, 5);
  const LastBlock wanted = last_block_by_zlib(packed);
  packed.bytes.back() ^= 1U;
  const auto found = find_in(packed.stream, packed.bytes);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->begin_bit, wanted.begin_bit);
}

// Skewed frequencies give codes of up to 15 bits.
TEST(DeflateBlocks, LongCodes) {
  Packed packed;
  Random random(3);
  for (int symbol = 0; symbol < 18; ++symbol) {
    for (int i = 0; i < (1 << symbol) / 4 + 1; ++i) {
      packed.bytes.push_back(static_cast<std::uint8_t>(symbol * 7));
    }
  }
  for (std::size_t i = packed.bytes.size(); i > 1; --i) {
    std::swap(packed.bytes[i - 1], packed.bytes[random.below(i)]);
  }
  z_stream stream{};
  ASSERT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, -15, 9, Z_HUFFMAN_ONLY), Z_OK);
  packed.stream.resize(deflateBound(&stream, packed.bytes.size()));
  stream.next_in = packed.bytes.data();
  stream.avail_in = static_cast<uInt>(packed.bytes.size());
  stream.next_out = packed.stream.data();
  stream.avail_out = static_cast<uInt>(packed.stream.size());
  ASSERT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.stream.resize(stream.total_out);
  deflateEnd(&stream);
  const LastBlock wanted = last_block_by_zlib(packed);
  const auto found = find_in(packed.stream, packed.bytes);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->begin_bit, wanted.begin_bit);
  EXPECT_EQ(found->end_bit, wanted.end_bit);
}

TEST(DeflateBlocks, WhatIsCutShortHasNone) {
  const Packed packed = packed_by_zlib(2000, 6, Z_DEFAULT_STRATEGY, 1);
  ASSERT_TRUE(find_in(packed.stream, packed.bytes));
  for (std::size_t size = 0; size < packed.stream.size(); ++size) {
    EXPECT_FALSE(find_in(std::span(packed.stream).first(size), packed.bytes)) << size;
  }
  Bytes longer = packed.stream;
  longer.push_back(0);
  EXPECT_FALSE(find_in(longer, packed.bytes));
}

// No flipped bit makes it read beyond the stream (the sanitizers look), and what it then finds lies
// inside.
TEST(DeflateBlocks, DamageIsSurvived) {
  const Packed packed = packed_by_zlib(2000, 6, Z_DEFAULT_STRATEGY, 2);
  int found = 0;
  for (std::size_t bit = 0; bit < packed.stream.size() * 8; ++bit) {
    Bytes damaged = packed.stream;
    damaged[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    if (const auto last = find_in(damaged, packed.bytes)) {
      ++found;
      EXPECT_LT(last->begin_bit, last->end_bit);
      EXPECT_LE(last->end_bit, damaged.size() * 8);
    }
  }
  EXPECT_GT(found, 0);
}

}  // namespace
}  // namespace sixpoint::gt3x
