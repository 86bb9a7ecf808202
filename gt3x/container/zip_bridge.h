// Between libzip and our seams (private to this room): a zip_source that pulls from a ByteSource.
//
//   std::optional<Error> failure;  // what `source` says, if it fails
//   zip_source_t* const entry = make_pulling_source(std::move(source), &failure);
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include <zip.h>

#include "gt3x/container/byte_source.h"

namespace sixpoint::gt3x {

// What libzip says about an error.
std::string describe(zip_error_t* error);

// Command bits for ZIP_SOURCE_SUPPORTS, from one or several command masks.
inline zip_int64_t zip_bit(zip_source_cmd_t command) {
  return ZIP_SOURCE_MAKE_COMMAND_BITMASK(command);
}

// For the callbacks of a zip_source. Keeps the first of our errors, tells libzip `code`, and gives
// what the callback returns.
zip_int64_t refuse(Error why, std::optional<Error>& first, int code, zip_error_t& error);
// ZIP_SOURCE_SEEK and ZIP_SOURCE_SEEK_WRITE in something of `size` bytes; moves `at`.
zip_int64_t seek(std::uint64_t& at, std::uint64_t size, void* data, zip_uint64_t length,
                 zip_error_t& error);

// A zip_source that reads `source` once, from its start to its end. It takes `source` along and
// frees it with itself. An error of the source is left in `*failure`, which must outlive the
// zip_source. nullptr when memory is short.
zip_source_t* make_pulling_source(std::unique_ptr<ByteSource> source,
                                  std::optional<Error>* failure);

}  // namespace sixpoint::gt3x
