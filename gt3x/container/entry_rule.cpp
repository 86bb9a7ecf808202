#include "gt3x/container/entry_rule.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/error.h"

namespace sixpoint::gt3x {
namespace {

constexpr const char* kPackAgain = "unpack it and pack it again as an ordinary zip";

std::string method_name(std::uint16_t method) {
  switch (method) {
    case 9:
      return "deflate64";
    case 12:
      return "bzip2";
    case 14:
      return "LZMA";
    case 93:
      return "Zstandard";
    case 95:
      return "XZ";
    case 98:
      return "PPMd";
    default:
      return fmt::format("method {}", method);
  }
}

}  // namespace

bool stays_inside(std::string_view name) {
  constexpr std::size_t kLongest = 255;
  const bool control =
      std::ranges::any_of(name, [](char c) { return static_cast<unsigned char>(c) < 0x20; });
  const bool drive = name.size() > 1 && name[1] == ':';
  if (name.empty() || name.size() > kLongest || control || drive) {
    return false;
  }
  constexpr std::string_view kSlashes = "/\\";
  if (kSlashes.find(name.front()) != std::string_view::npos) {
    return false;
  }
  if (kSlashes.find(name.back()) != std::string_view::npos) {
    return false;
  }
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find_first_of(kSlashes, begin), name.size());
    if (name.substr(begin, end - begin) == "..") {
      return false;
    }
    begin = end + 1;
  }
  return true;
}

std::optional<Refusal> why_refused(const EntryHeader& header, const ArchiveLimits& limits) {
  const std::string shown = printable(header.name, 60);
  if (!stays_inside(header.name)) {
    return Refusal{fmt::format("the archive holds an entry whose path leaves it: '{}'", shown),
                   "pack the recording's files again, with names inside the archive"};
  }
  if (header.symbolic_link) {
    return Refusal{fmt::format("entry {} is a symbolic link, not a file", shown),
                   "pack the file itself"};
  }
  if (header.encrypted) {
    return Refusal{fmt::format("entry {} is encrypted", shown), kPackAgain};
  }
  if (header.method != kMethodStore && header.method != kMethodDeflate) {
    return Refusal{fmt::format("entry {} is packed by {}, which recordings are not", shown,
                               method_name(header.method)),
                   kPackAgain};
  }
  if (!limits.allow(header.size, header.packed_size)) {
    return Refusal{
        fmt::format("entry {} claims {} bytes, more than a recording can have", shown, header.size),
        "check that this is a recording"};
  }
  return std::nullopt;
}

}  // namespace sixpoint::gt3x
