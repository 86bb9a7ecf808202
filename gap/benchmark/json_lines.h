// The rows of a JSON Lines text.
//
//   for (const auto& [line, row] : rows_of("{}\n\n{}\n")) {
//     std::cout << line << ": " << row << '\n';  // 1: {} and 3: {}
//   }
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

namespace sixpoint::gap {

// Those that are not empty, with their numbers from 1 on. The text must outlive the answer.
inline std::vector<std::pair<std::size_t, std::string_view>> rows_of(std::string_view text) {
  std::vector<std::pair<std::size_t, std::string_view>> rows;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    if (end > 0) {
      rows.emplace_back(line, text.substr(0, end));
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return rows;
}

}  // namespace sixpoint::gap
