#include "cli/people_text.h"

#include <algorithm>
#include <array>
#include <ctime>
#include <sstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "repair/archive/archive_scripts.h"

namespace sixpoint::cli {

namespace {

// Characters of UTF-8: the bytes that do not go on with one.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

// Three numbers, or none.
bool are_three(const Json& json, const char* key) {
  return json.is_object() && json.contains(key) && json[key].is_array() && json[key].size() == 3 &&
         json[key][0].is_number() && json[key][1].is_number() && json[key][2].is_number();
}

}  // namespace

std::string local_time(UtcTime time) {
  const std::time_t seconds = to_unix_seconds(time);
  std::tm broken_down{};
  if (localtime_r(&seconds, &broken_down) == nullptr) {
    return to_iso8601(time);
  }
  std::array<char, 64> text{};
  const std::size_t length =
      std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S %z", &broken_down);
  const std::string_view all(text.data(), length);  // "... +0100"
  return fmt::format("{}:{}", all.substr(0, length - 2), all.substr(length - 2));
}

Columns::Columns(std::vector<std::string> names) { rows_.push_back(std::move(names)); }

void Columns::row(std::vector<std::string> texts) { rows_.push_back(std::move(texts)); }

std::string Columns::text() const {
  if (rows_.size() == 1) {
    return {};
  }
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < std::min(row.size(), widths.size()); ++i) {
      widths[i] = std::max(widths[i], width_of(row[i]));
    }
  }
  std::string out;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < std::min(row.size(), widths.size()); ++i) {
      line += row[i] + std::string(widths[i] - width_of(row[i]) + 2, ' ');
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

std::string constants_text(const Json& constants) {
  if (!are_three(constants, "sensitivity_g_per_lsb") || !are_three(constants, "zero_lsb")) {
    return {};
  }
  std::string sensitivity = "sensitivity";
  std::string zero = "zero";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double g_per_lsb = constants["sensitivity_g_per_lsb"][axis];
    if (g_per_lsb == 0) {
      return {};
    }
    sensitivity += fmt::format(" {:.3f}", 1 / g_per_lsb);
    zero += fmt::format(" {:.2f}", constants["zero_lsb"][axis].get<double>());
  }
  return fmt::format("{} LSB/g, {} LSB", sensitivity, zero);
}

std::string without_password(const std::string& word) {
  const std::size_t colon = std::min(word.find("://"), word.size());
  const std::string_view scheme = std::string_view(word).substr(0, colon);
  if (colon == word.size() || !(scheme.ends_with("postgresql") || scheme.ends_with("postgres"))) {
    return word;
  }
  const std::size_t begin = colon + 3;
  const std::size_t settings = std::min(word.find('?', begin), word.size());
  std::string place = word.substr(begin, settings - begin);
  const std::size_t host = place.rfind('@');
  if (const std::size_t password = place.find(':'); host != std::string::npos && password < host) {
    place.erase(password, host - password);
  }
  std::string kept = word.substr(0, begin) + place;
  std::istringstream rest(word.substr(std::min(settings + 1, word.size())));
  char before = '?';
  for (std::string setting; std::getline(rest, setting, '&');) {
    if (!setting.starts_with("password=") && !setting.starts_with("sslpassword=")) {
      kept += std::exchange(before, '&') + setting;
    }
  }
  return kept;
}

std::string bash_word(const std::string& given) {
  const std::string word = without_password(given);
  if (printable(word) == word) {
    return repair::shell_word(word);
  }
  std::string quoted = "$'";
  for (const char c : word) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte >= 0x7F) {
      quoted += fmt::format("\\x{:02x}", byte);
    } else {
      quoted.append(c == '\'' || c == '\\' ? 1 : 0, '\\').append(1, c);
    }
  }
  return quoted + "'";
}

void next_step(Context& context, bool as_json, const std::vector<std::string>& words) {
  if (as_json) {
    return;
  }
  std::string line = "next: sixpoint";
  for (const std::string& word : words) {
    line.append(1, ' ').append(bash_word(word));
  }
  context.people << line << '\n';
}

std::string path_word(const std::string& path) {
  return path.starts_with('-') ? "./" + path : path;
}

std::vector<std::string> some_paths(const std::vector<std::string>& paths) {
  constexpr std::size_t kMost = 3;
  std::vector<std::string> some;
  for (std::size_t i = 0; i < std::min(kMost, paths.size()); ++i) {
    some.push_back(path_word(paths[i]));
  }
  if (paths.size() > kMost) {
    some.emplace_back("...");
  }
  return some;
}

}  // namespace sixpoint::cli
