#include "device/unit_registry.h"

namespace sixpoint::device {

void UnitRegistry::add(std::string scheme, std::string example, Opener opener) {
  entries_[std::move(scheme)] = Entry{std::move(example), std::move(opener)};
}

Result<std::unique_ptr<Unit>> UnitRegistry::open(std::string_view address, Env& env,
                                                 const LinkWrapper& wrap) const {
  const std::size_t colon = address.find(':');
  const auto entry = entries_.find(address.substr(0, colon));
  if (colon != std::string_view::npos && entry != entries_.end()) {
    return entry->second.opener(address.substr(colon + 1), env);
  }
  SIXPOINT_ASSIGN(Link link, links_.open(address, env));
  if (wrap) {
    wrap(link);
  }
  return Unit::open(std::move(link));
}

std::vector<std::string> UnitRegistry::examples() const {
  std::vector<std::string> list = links_.examples();
  for (const auto& [scheme, entry] : entries_) {
    list.push_back(entry.example);
  }
  return list;
}

}  // namespace sixpoint::device
