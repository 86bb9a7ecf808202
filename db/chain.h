// The hash chain over the store's whole history.
//
//   ChainHasher hasher;
//   const Sha256Digest first = hasher.hash(Bytes(32, 0), table("units"), 1, columns);
//
//     hash(row 0) = 32 zero bytes
//     hash(row n) = SHA-256( hash(row n-1) | canonical bytes of row n )
//
// Canonical bytes: the table's name as a text, seq as an integer, then every column in the order of
// schema.h. An integer is 0x01 and 8 bytes big-endian; a text is 0x02, its length in 8 bytes
// big-endian and its bytes; NULL is 0x00. Nothing else exists, so two different rows never have the
// same bytes. Columns that a later version of the schema added stand last, and those of them that
// are NULL at the end of a row are left out: a row has the same hash before and after the store was
// brought to a newer version. docs/store.md describes the same for other programs.
#pragma once

#include <span>
#include <string_view>

#include "base/sha256.h"
#include "db/schema.h"
#include "db/servers/database.h"

namespace sixpoint::db {

// Keeps its buffers from row to row: an audit of millions of rows allocates nothing per row.
class ChainHasher {
 public:
  // `columns`: all of the table's, in order, without seq and hash.
  Sha256Digest hash(std::span<const std::uint8_t> previous, const Table& table, std::int64_t seq,
                    std::span<const Value> columns);
  // The row's id: the first 32 hex digits of its hash without key, seq and the hash of the row
  // before.
  std::string identifier(const Table& table, std::span<const Value> columns_without_key);

 private:
  Sha256Digest finish(std::span<const Value> columns);
  Bytes bytes_;
  Sha256 sha256_;
};

}  // namespace sixpoint::db
