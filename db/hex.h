// Bytes as lower-case hexadecimal digits, back again (to_hex() is in base/sha256.h).
#pragma once

#include <string_view>

#include "base/env.h"
#include "base/result.h"

namespace sixpoint::db {

Result<Bytes> from_hex(std::string_view text);

}  // namespace sixpoint::db
