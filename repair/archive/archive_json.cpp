#include "repair/archive/archive_json.h"

#include <fmt/format.h>

namespace sixpoint::repair {

std::string encode_path(std::string_view path) {
  std::string text;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte > 0x7e || c == '%') {
      text += fmt::format("%{:02X}", byte);
    } else {
      text += c;
    }
  }
  return text;
}

Result<std::string> decode_path(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
  };
  std::string path;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      path += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? digit(text[i + 1]) : -1;
    const int low = i + 2 < text.size() ? digit(text[i + 2]) : -1;
    if (high < 0 || low < 0) {
      return fail(ErrorCode::bad_data, "a file name of the plan is damaged",
                  std::string(text.substr(0, 200)), "make the plan anew");
    }
    path += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return path;
}

nlohmann::ordered_json error_to_json(const Error& error) {
  return {{"code", static_cast<int>(error.code)},
          {"what", error.what},
          {"where", encode_path(error.where)},
          {"hint", error.hint}};
}

Result<Error> error_from_json(const nlohmann::ordered_json& json) {
  const int code = integer_of<int>(json.at("code"));
  if (!is_error_code(code)) {
    return fail(ErrorCode::bad_data, "an error of no known kind", {}, "make the plan anew");
  }
  SIXPOINT_ASSIGN(std::string where, decode_path(json.at("where").get<std::string>()));
  return Error{static_cast<ErrorCode>(code), json.at("what").get<std::string>(), std::move(where),
               json.at("hint").get<std::string>()};
}

}  // namespace sixpoint::repair
