#include "base/error.h"

#include <fmt/format.h>

namespace sixpoint {

bool is_error_code(int number) {
  const auto code = static_cast<ErrorCode>(number);
  return code == ErrorCode::internal || to_string(code) != to_string(ErrorCode::internal);
}

std::string_view to_string(ErrorCode code) {
  switch (code) {
    case ErrorCode::usage:
      return "usage";
    case ErrorCode::bad_data:
      return "bad_data";
    case ErrorCode::no_input:
      return "no_input";
    case ErrorCode::device_unavailable:
      return "device_unavailable";
    case ErrorCode::internal:
      return "internal";
    case ErrorCode::cannot_create:
      return "cannot_create";
    case ErrorCode::io:
      return "io";
    case ErrorCode::permission:
      return "permission";
    case ErrorCode::configuration:
      return "configuration";
  }
  return "internal";
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string out;
  for (const char c : text.substr(0, limit)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7F) {
      out += fmt::format("\\x{:02x}", byte);
    } else {
      out += c;
    }
  }
  if (text.size() > limit) {
    out += "...";
  }
  return out;
}

std::string Error::brief() const {
  std::string line;
  if (!where.empty()) {
    line += printable(where) + ": ";
  }
  line += printable(what, 2000);
  if (!hint.empty()) {
    line += "; " + printable(hint, 2000);
  }
  return line;
}

}  // namespace sixpoint
