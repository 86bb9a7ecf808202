// A file's whole text; for the tests of file systems.
#pragma once

#include <string>

#include "base/env.h"

namespace sixpoint {

// "<what went wrong>" where it cannot be read.
inline std::string text_of(FileSystem& files, const std::string& path) {
  const auto bytes = read_file(files, path);
  return bytes ? std::string(bytes->begin(), bytes->end()) : "<" + bytes.error().what + ">";
}

}  // namespace sixpoint
