#include "device/jig_registry.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint::device {

Result<std::unique_ptr<Jig>> JigRegistry::open(std::string_view address, Env& env,
                                               Unit& unit) const {
  if (const auto found = openers_.find(address)) {
    return found->opener(found->rest, env, unit);
  }
  return fail(ErrorCode::usage,
              fmt::format("'{}' is no jig this program can open", printable(address, 80)), {},
              fmt::format("use one of: {}", fmt::join(openers_.examples({"manual"}), ", ")));
}

}  // namespace sixpoint::device
