#include "base/text/counted.h"

#include <fmt/format.h>

namespace sixpoint {

std::string counted(std::size_t count, std::string_view noun) {
  if (count == 1) {
    return fmt::format("1 {}", noun);
  }
  const bool ies = noun.ends_with('y');
  return fmt::format("{} {}{}", count, noun.substr(0, noun.size() - (ies ? 1 : 0)),
                     ies ? "ies" : "s");
}

}  // namespace sixpoint
