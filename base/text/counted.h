// A number and what it counts, for people.
//
//   counted(1, "file");    // 1 file
//   counted(3, "entry");   // 3 entries
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sixpoint {

// `noun` in the singular; its plural ends with s, and with ies where it ends with y.
std::string counted(std::size_t count, std::string_view noun);

}  // namespace sixpoint
