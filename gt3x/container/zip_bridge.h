// Between libzip and our seams (private to this room): a zip_source that pulls from a ByteSource.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <zip.h>

#include "gt3x/byte_source.h"

namespace sixpoint::gt3x {

// What libzip says about an error, in words.
std::string describe(zip_error_t* error);

// Command bits for ZIP_SOURCE_SUPPORTS, from one or several command masks.
inline zip_int64_t zip_bit(zip_source_cmd_t command) {
  return ZIP_SOURCE_MAKE_COMMAND_BITMASK(command);
}

// A zip_source that reads `source` once, from its start to its end. It takes `source` along and
// frees it with itself. An error of the source is left in `*failure`, which must outlive the
// zip_source. nullptr when memory is short.
zip_source_t* make_pulling_source(std::unique_ptr<ByteSource> source,
                                  std::optional<Error>* failure);

}  // namespace sixpoint::gt3x
