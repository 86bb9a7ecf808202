#include "device/corner.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::device {

std::string to_string(const Corner& corner) {
  std::string text;
  for (std::size_t a = 0; a < kAxes; ++a) {
    text += corner.signs[a] > 0 ? '+' : '-';
    text += "xyz"[a];
  }
  return text;
}

Result<Corner> parse_corner(std::string_view text) {
  const auto* const found = std::find_if(kCorners.begin(), kCorners.end(),
                                         [&](const Corner& one) { return to_string(one) == text; });
  if (found != kCorners.end()) {
    return *found;
  }
  return fail(ErrorCode::usage, fmt::format("'{}' is no corner", printable(text, 20)), "",
              "use a sign for each axis: +x+y+z to -x-y-z");
}

PerAxis<double> direction_of(const Corner& corner) {
  PerAxis<double> force_g{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    force_g[a] = corner.signs[a] / std::sqrt(3.0);
  }
  return force_g;
}

}  // namespace sixpoint::device
