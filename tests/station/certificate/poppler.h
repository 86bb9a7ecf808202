// What poppler and zbar read from a PDF, for tests.
#pragma once

#include <array>
#include <cstdio>
#include <string>

#include "skip_unless.h"

namespace sixpoint::station {

inline std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) {
    return text;
  }
  std::array<char, 4096> buffer{};
  for (std::size_t got = 0; (got = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
    text.append(buffer.data(), got);
  }
  ::pclose(pipe);
  return text;
}

inline bool has_tools() {
  return output_of("for tool in pdftotext pdftoppm zbarimg; do command -v $tool; done | wc -l")
      .starts_with("3");
}
#define NEEDS_TOOLS()                                                        \
  SIXPOINT_SKIP_UNLESS(has_tools(),                                          \
                       "pdftotext, pdftoppm or zbarimg is missing; install " \
                       "the Debian packages poppler-utils and zbar-tools")

}  // namespace sixpoint::station
