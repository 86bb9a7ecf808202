#include "repair/archive/link_file.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include <unistd.h>

namespace sixpoint::repair {
namespace {

constexpr std::array<std::string_view, 3> kLinkNames = {"none", "hard", "symbolic"};

}  // namespace

std::string_view to_string(LinkKind kind) { return kLinkNames[static_cast<std::size_t>(kind)]; }

std::optional<LinkKind> parse_link_kind(std::string_view text) {
  for (std::size_t i = 0; i < kLinkNames.size(); ++i) {
    if (kLinkNames[i] == text) {
      return static_cast<LinkKind>(i);
    }
  }
  return std::nullopt;
}

Status link_file(const std::string& from, const std::string& to, LinkKind kind) {
  if (kind == LinkKind::none) {
    return {};
  }
  std::error_code error;
  const std::filesystem::path real = std::filesystem::canonical(from, error);
  if (error) {
    return fail(ErrorCode::no_input, error.message(), from);
  }
  const int made = kind == LinkKind::hard ? ::link(real.c_str(), to.c_str())
                                          : ::symlink(real.c_str(), to.c_str());
  if (made == 0) {
    return {};
  }
  const int number = errno;
  if (number == EEXIST && std::filesystem::equivalent(real, to, error) && !error) {
    return {};
  }
  if (number == EXDEV) {
    return fail(ErrorCode::cannot_create, "a hard link cannot lead to another file system", to,
                "choose symbolic links, or a folder on the same file system");
  }
  if (number == EEXIST) {
    return fail(ErrorCode::cannot_create, "a file of that name is there already", to,
                "move it away, or choose another folder");
  }
  return fail(number == ENOENT ? ErrorCode::cannot_create : ErrorCode::io, std::strerror(number),
              to, "");
}

}  // namespace sixpoint::repair
