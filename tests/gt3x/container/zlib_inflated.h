// The other implementation: what zlib reads out of a stream of `size` unpacked bytes.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/bytes.h"

namespace sixpoint::gt3x {

// As inflateInit2() has them.
inline constexpr int kRawStream = -15;
inline constexpr int kGzipFile = 15 + 16;

inline Bytes inflated_by_zlib(Bytes in, std::size_t size, int kind) {
  z_stream state{};
  EXPECT_EQ(inflateInit2(&state, kind), Z_OK);
  Bytes out(size + 1);
  state.next_in = in.data();
  state.avail_in = static_cast<uInt>(in.size());
  state.next_out = out.data();
  state.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&state, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(state.avail_in, 0U);
  out.resize(state.total_out);
  inflateEnd(&state);
  return out;
}

}  // namespace sixpoint::gt3x
