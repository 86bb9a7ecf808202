#include "base/error.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

namespace sixpoint {

namespace {

constexpr std::array<std::pair<ErrorCode, std::string_view>, 9> kErrorNames = {{
    {ErrorCode::usage, "usage"},
    {ErrorCode::bad_data, "bad_data"},
    {ErrorCode::no_input, "no_input"},
    {ErrorCode::device_unavailable, "device_unavailable"},
    {ErrorCode::internal, "internal"},
    {ErrorCode::cannot_create, "cannot_create"},
    {ErrorCode::io, "io"},
    {ErrorCode::permission, "permission"},
    {ErrorCode::configuration, "configuration"},
}};

const auto* entry_of(ErrorCode code) {
  return std::ranges::find(kErrorNames, code, &std::pair<ErrorCode, std::string_view>::first);
}

}  // namespace

bool is_error_code(int number) {
  return entry_of(static_cast<ErrorCode>(number)) != kErrorNames.end();
}

std::string_view to_string(ErrorCode code) {
  const auto* entry = entry_of(code);
  return entry == kErrorNames.end() ? "internal" : entry->second;
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
