#include "device/transport.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint::device {

std::shared_ptr<Clock> borrow_clock(Clock& clock) {
  return {std::shared_ptr<void>(), &clock};  // owns nothing
}

void TransportRegistry::add(std::string scheme, std::string example, Opener opener) {
  entries_[std::move(scheme)] = Entry{std::move(example), std::move(opener)};
}

Result<Link> TransportRegistry::open(std::string_view address, Env& env) const {
  const std::size_t colon = address.find(':');
  const auto entry = entries_.find(address.substr(0, colon));
  if (colon == std::string_view::npos || entry == entries_.end()) {
    return fail(ErrorCode::usage,
                fmt::format("'{}' is no device this program can open", printable(address, 80)), {},
                fmt::format("use one of: {}", fmt::join(examples(), ", ")));
  }
  Result<Link> link = entry->second.opener(address.substr(colon + 1), env);
  if (link) {
    link->address = std::string(address);
    if (!link->reopen) {
      link->reopen = [opener = entry->second.opener, rest = std::string(address.substr(colon + 1)),
                      &env] { return opener(rest, env); };
    }
  }
  return link;
}

std::vector<std::string> TransportRegistry::examples() const {
  std::vector<std::string> list;
  list.reserve(entries_.size());
  for (const auto& [scheme, entry] : entries_) {
    list.push_back(entry.example);
  }
  return list;
}

}  // namespace sixpoint::device
