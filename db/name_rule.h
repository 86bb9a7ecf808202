// Which texts the store takes as names: of an operator, a station, a jig.
//
//   SIXPOINT_CHECK(check_name("Ada"));  // before the run whose record has it
//
// A record with another text is refused when it is added, and then the work is done.
#pragma once

#include <string_view>

#include "base/result.h"

namespace sixpoint::db {

// Up to 200 bytes of UTF-8 without NUL (RFC 3629); bad_data otherwise. Empty is a name, too.
Status check_name(std::string_view name);

}  // namespace sixpoint::db
