// Whether bytes are UTF-8, as RFC 3629 has it.
//
//   is_utf8("\xC3\x96l.txt");  // true
//   is_utf8("\x99l.txt");      // false: the same name in the characters of MS-DOS
#pragma once

#include <string_view>

namespace sixpoint {

bool is_utf8(std::string_view text);

}  // namespace sixpoint
