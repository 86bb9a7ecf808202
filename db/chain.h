// The hash chain over the store's whole history.
//
//   hash(row n) = SHA-256( hash(row n-1) | canonical bytes of row n ),  hash(row 0) = 32 zero bytes
//
// Canonical bytes: the table's name as a text, seq as an integer, then every column in the order of
// schema.h. An integer is 0x01 and 8 bytes big-endian; a text is 0x02, its length in 8 bytes
// big-endian and its bytes; NULL is 0x00. Nothing else exists, so two different rows never have the
// same bytes. docs/store.md describes the same for other programs.
#pragma once

#include <span>
#include <string_view>

#include "base/sha256.h"
#include "db/database.h"

namespace sixpoint::db {

Sha256Digest chain_hash(std::span<const std::uint8_t> previous, std::string_view table,
                        std::int64_t seq, std::span<const Value> columns);

}  // namespace sixpoint::db
