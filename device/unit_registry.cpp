#include "device/unit_registry.h"

namespace sixpoint::device {

Result<std::unique_ptr<Unit>> UnitRegistry::open(std::string_view address, Env& env,
                                                 const LinkWrapper& wrap) const {
  if (const auto found = openers_.find(address)) {
    return found->opener(found->rest, env);
  }
  if (!links_.knows(address)) {
    return no_device(address, examples());
  }
  SIXPOINT_ASSIGN(Link link, links_.open(address, env));
  if (wrap) {
    wrap(link);
  }
  return over_link_(std::move(link));
}

}  // namespace sixpoint::device
