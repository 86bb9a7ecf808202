#include "gt3x/container/byte_source.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

TEST(ByteSource, MemoryComesInPieces) {
  MemorySource source(Bytes{1, 2, 3});
  EXPECT_EQ(source.size(), 3U);
  Bytes piece(2);
  EXPECT_EQ(source.read(piece).value(), 2U);
  EXPECT_EQ(piece, (Bytes{1, 2}));
  EXPECT_EQ(source.read(piece).value(), 1U);
  EXPECT_EQ(piece[0], 3);
  EXPECT_EQ(source.read(piece).value(), 0U);
}

TEST(ByteSource, EverythingUpToTheLimit) {
  MemorySource three(Bytes{1, 2, 3});
  EXPECT_EQ(read_all(three, 3).value(), (Bytes{1, 2, 3}));
  MemorySource four(Bytes{1, 2, 3, 4});
  EXPECT_FAILS(read_all(four, 3), ErrorCode::bad_data);
  MemorySource large(Bytes(200'000, 7));
  EXPECT_EQ(read_all(large, 1U << 20)->size(), 200'000U);
}

}  // namespace
}  // namespace sixpoint::gt3x
