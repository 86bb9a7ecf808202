// Unpacks a deflated entry with an index (sync_points.h) on several threads; its bytes come out in
// order.
//
//   SyncPoints points;  // of the entry; its packed bytes are in `packed`
//   const auto bytes = unpack_pieces(std::move(packed), points, 2'200'000);
//   SIXPOINT_ASSIGN(const std::size_t count, bytes->read(piece));
//
// These threads read the packed bytes too, one at a time and in order; they begin with the first
// read() and end with the object, also in the middle. Who waits in read() helps them. Memory: for
// every thread, and twice more, a piece and its packed bytes. read() answers bad_data where the
// pieces are not what the index says, and an error of `packed` at its place; after an error the
// same one.
#pragma once

#include <cstdint>
#include <memory>

#include "gt3x/container/byte_source.h"
#include "gt3x/container/sync_points.h"

namespace sixpoint::gt3x {

// `size`: of the unpacked entry.
std::unique_ptr<ByteSource> unpack_pieces(std::unique_ptr<ByteSource> packed, SyncPoints points,
                                          std::uint64_t size);

}  // namespace sixpoint::gt3x
