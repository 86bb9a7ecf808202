#include "gt3x/container/sync_points.h"

#include <gtest/gtest.h>

namespace sixpoint::gt3x {
namespace {

// Oracle: the table in the header, by hand.
TEST(SyncPoints, AsTheHeaderSays) {
  SyncPoints points;
  points.packed_sizes = {0x010203, 5};
  const Bytes field = to_extra_field(points);
  EXPECT_EQ(field, (Bytes{0x53, 0x50, 13, 0, 1, 0, 0, 0x10, 0, 3, 2, 1, 0, 5, 0, 0, 0}));
  const EntrySizes entry = {kPackedPieceSize + 1, 0x010203 + 5};
  const auto read = parse_sync_points(std::span(field).subspan(4), entry);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->packed_sizes, points.packed_sizes);
  EXPECT_EQ(read->piece_size, kPackedPieceSize);
}

TEST(SyncPoints, OnePieceAndTooManyHaveNone) {
  SyncPoints points;
  EXPECT_TRUE(to_extra_field(points).empty());
  points.packed_sizes = {5};
  EXPECT_TRUE(to_extra_field(points).empty());
  points.packed_sizes.assign(16'000, 5);
  EXPECT_LT(to_extra_field(points).size(), 65'535U - 28) << "zip64's own field stands beside it";
  points.packed_sizes.push_back(5);
  EXPECT_TRUE(to_extra_field(points).empty());
}

TEST(SyncPoints, WhatDoesNotFitTheEntryIsNoIndex) {
  SyncPoints points;
  points.packed_sizes = {1000, 2000, 30};
  const Bytes field = to_extra_field(points);
  const Bytes good(field.begin() + 4, field.end());
  const EntrySizes entry = {2 * kPackedPieceSize + 7, 3030};
  ASSERT_TRUE(parse_sync_points(good, entry));
  EXPECT_FALSE(parse_sync_points(good, {2 * kPackedPieceSize, 3030})) << "two pieces";
  EXPECT_FALSE(parse_sync_points(good, {entry.bytes, 3031}));
  EXPECT_FALSE(parse_sync_points({}, entry));
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(parse_sync_points(std::span(good).first(size), entry)) << size;
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    Bytes wrong = good;
    wrong[at] ^= 0x80;
    EXPECT_FALSE(parse_sync_points(wrong, entry)) << at;
  }
  // Pieces that would take more memory than a reader should give.
  SyncPoints large;
  large.piece_size = 5U << 20;
  large.packed_sizes = {1000, 2030};
  const Bytes large_field = to_extra_field(large);
  EXPECT_FALSE(parse_sync_points(std::span(large_field).subspan(4), {(5U << 20) + 7, 3030}));
}

}  // namespace
}  // namespace sixpoint::gt3x
