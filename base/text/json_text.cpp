#include "base/text/json_text.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/error.h"

namespace sixpoint {
namespace {

using Json = nlohmann::json;

// Keeps the place of the error alone.
class ErrorPlace final : public nlohmann::json_sax<Json> {
 public:
  bool null() override { return true; }
  bool boolean(bool /*given*/) override { return true; }
  bool number_integer(number_integer_t /*given*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*given*/) override { return true; }
  bool number_float(number_float_t /*given*/, const string_t& /*text*/) override { return true; }
  bool string(string_t& /*given*/) override { return true; }
  bool binary(binary_t& /*given*/) override { return true; }
  bool start_object(std::size_t /*size*/) override { return true; }
  bool end_object() override { return true; }
  bool start_array(std::size_t /*size*/) override { return true; }
  bool end_array() override { return true; }
  bool key(string_t& /*name*/) override { return true; }
  bool parse_error(std::size_t position, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*error*/) override {
    at = position;
    return false;
  }

  std::size_t at = 0;  // behind the word that is wrong
};

}  // namespace

bool nests_too_deep(std::string_view json) {
  constexpr int kMostLevels = 100;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (c == '"') {
      in_string = !in_string;
    } else if (in_string) {
      i += c == '\\' ? 1 : 0;  // the character behind it ends nothing
    } else if (c == '[' || c == '{') {
      if (++depth > kMostLevels) {
        return true;
      }
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

std::string why_no_json(std::string_view text) {
  if (nests_too_deep(text)) {
    return "it nests deeper than 100 objects and lists";
  }
  ErrorPlace place;
  if (Json::sax_parse(text, &place)) {
    return {};
  }
  if (place.at == 0 || place.at > text.size()) {
    return "it ends too early";
  }
  const auto before = text.substr(0, place.at);
  const std::size_t word = before.find_last_of(" \t\r\n,:[]{}") + 1;  // 0 where there is none
  return fmt::format("line {} at '{}'", 1 + std::ranges::count(before, '\n'),
                     printable(before.substr(std::min(word, before.size() - 1)), 40));
}

}  // namespace sixpoint
