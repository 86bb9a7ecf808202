// Options whose text stands in every record of a run, refused before anything is measured.
//
//   SIXPOINT_CHECK(check_name_option("--station", "bench 3"));
#pragma once

#include <string>

#include "base/result.h"

namespace sixpoint::cli {

// usage where no store takes the text as a name (db/name_rule.h). Empty is a name, too.
Status check_name_option(const char* option, const std::string& text);

}  // namespace sixpoint::cli
