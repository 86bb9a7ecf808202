// A second name for a file that is there: a hard link or a symbolic one.
//
//   SIXPOINT_CHECK(link_file("/data/a.gt3x", "/study/a.gt3x", LinkKind::hard));
//
// On the real disk only; a library that makes links is given this as a function.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace sixpoint::repair {

enum class LinkKind : std::uint8_t { none, hard, symbolic };
std::string_view to_string(LinkKind kind);  // "none", "hard", "symbolic"
std::optional<LinkKind> parse_link_kind(std::string_view text);

// Whatever is at `to` already stays: it is no error where it is a link to `from` already, and
// cannot_create otherwise. A symbolic link holds the real path of `from`. Nothing for `none`.
Status link_file(const std::string& from, const std::string& to, LinkKind kind);

}  // namespace sixpoint::repair
