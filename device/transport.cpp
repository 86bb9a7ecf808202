#include "device/transport.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint::device {

std::shared_ptr<Clock> borrow_clock(Clock& clock) {
  return {std::shared_ptr<void>(), &clock};  // owns nothing
}

tl::unexpected<Error> no_device(std::string_view address,
                                const std::vector<std::string>& examples) {
  return fail(ErrorCode::usage,
              fmt::format("'{}' is no device this program can open", printable(address, 80)), {},
              fmt::format("use one of: {}", fmt::join(examples, ", ")));
}

Result<Link> TransportRegistry::open(std::string_view address, Env& env) const {
  const auto found = openers_.find(address);
  if (!found) {
    return no_device(address, examples());
  }
  Result<Link> link = found->opener(found->rest, env);
  if (link) {
    link->address = std::string(address);
    if (!link->reopen) {
      link->reopen = [opener = found->opener, rest = std::string(found->rest), &env] {
        return opener(rest, env);
      };
    }
  }
  return link;
}

}  // namespace sixpoint::device
