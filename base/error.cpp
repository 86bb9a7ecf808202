#include "base/error.h"

#include <algorithm>
#include <array>
#include <new>
#include <system_error>
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

Error error_of(const std::exception& exception) {
  constexpr const char* kNoMemory = "not enough memory";
  constexpr const char* kMoreMemory =
      "end other programs, raise the limit ('ulimit -v', or the batch system's), or work on fewer "
      "files at a time (--jobs)";
  if (dynamic_cast<const std::bad_alloc*>(&exception) != nullptr) {
    return {ErrorCode::io, kNoMemory, "", kMoreMemory};
  }
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&exception)) {
    if (of_system->code() == std::errc::not_enough_memory) {
      return {ErrorCode::io, kNoMemory, "", kMoreMemory};
    }
    if (of_system->code() == std::errc::resource_unavailable_try_again) {
      return {ErrorCode::io, "the system gives this program no more threads", "",
              "end other programs, raise the limits ('ulimit -u', 'ulimit -v'), or work on fewer "
              "files at a time (--jobs)"};
    }
  }
  return {ErrorCode::internal, fmt::format("internal error: {}", printable(exception.what())), "",
          "please report it with the command line"};
}

Error error_of(const std::exception_ptr& thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const std::exception& exception) {
    return error_of(exception);
  }
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
