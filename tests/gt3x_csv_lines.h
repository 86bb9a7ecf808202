// CSV files that tests compare line for line.
#pragma once

#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include <zlib.h>

namespace sixpoint::gt3x::tests {

inline std::string gunzipped(const std::string& path) {
  std::string text;
  gzFile file = gzopen(path.c_str(), "rb");
  std::vector<char> piece(1 << 16);
  for (int count = 0; (count = gzread(file, piece.data(), 1 << 16)) > 0;) {
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
  gzclose(file);
  return text;
}

inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    while (!line.empty() && line.back() == '\r') {
      line.pop_back();
    }
    lines.push_back(line);
  }
  return lines;
}

}  // namespace sixpoint::gt3x::tests
