// Where docs/faults.md says that a fault is tested, and where it is: each test of plans holds its
// own column of the page's last table against its plans.
#pragma once

#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sixpoint::tests {

inline std::string source_text(const std::string& name) {
  std::ifstream in(std::string(SIXPOINT_SOURCE_DIR) + "/" + name, std::ios::binary);
  std::ostringstream all;
  all << in.rdbuf();
  EXPECT_FALSE(all.str().empty()) << name;
  return all.str();
}

// The faults of all plans in a text, as the table names them: `unplug` for ever and for a while are
// two.
inline std::set<std::string> faults_in(const std::string& text) {
  static const std::regex kFault(R"re(\{"fault": "[^{}]*\})re");
  std::set<std::string> names;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kFault);
       at != std::sregex_iterator(); ++at) {
    const auto fault = nlohmann::json::parse(at->str(), nullptr, false);
    if (!fault.is_object()) {
      ADD_FAILURE() << "this is no fault: " << at->str();
      continue;
    }
    std::string name = "`" + fault["fault"].get<std::string>() + "`";
    if (name == "`unplug`") {
      name += fault.contains("seconds") ? " and back" : " for good";
    }
    names.insert(name);
  }
  return names;
}

// Of rows with a plan in `faults`.
template <class Rows>
std::set<std::string> faults_of_rows(const Rows& rows) {
  std::set<std::string> names;
  for (const auto& row : rows) {
    names.merge(faults_in(row.faults));
  }
  return names;
}

inline std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  std::string cell;
  std::getline(in, cell, '|');
  while (std::getline(in, cell, '|')) {
    const std::size_t first = std::min(cell.find_first_not_of(' '), cell.size());
    cells.push_back(cell.substr(first, cell.find_last_not_of(' ') + 1 - first));
  }
  return cells;
}

// The faults that have "yes" in this column of the page's last table.
inline std::set<std::string> faults_of_column(const std::string& column) {
  std::istringstream page(source_text("docs/faults.md"));
  std::set<std::string> names;
  std::size_t wanted = 0;
  for (std::string line; std::getline(page, line);) {
    const auto cells = cells_of(line);
    if (wanted == 0) {
      const auto found = std::find(cells.begin(), cells.end(), column);
      wanted = found == cells.end() ? 0 : static_cast<std::size_t>(found - cells.begin());
      continue;
    }
    if (cells.size() <= wanted) {
      break;
    }
    if (cells[wanted] != "yes") {
      EXPECT_TRUE(cells[wanted] == "-" || cells[wanted] == "---") << line;
      continue;
    }
    std::istringstream grouped(cells.front());
    for (std::string name; std::getline(grouped, name, ',');) {
      names.insert(name.substr(std::min(name.find('`'), name.size())));
    }
  }
  EXPECT_FALSE(names.empty()) << "docs/faults.md has no column " << column;
  return names;
}

}  // namespace sixpoint::tests
