#include "device/jig_registry.h"

#include <fmt/format.h>

#include "device/discovery.h"
#include "device/hid_jig.h"
#include "device/hid_transport.h"

namespace sixpoint::device {

void JigRegistry::add(std::string scheme, std::string example, Opener opener) {
  entries_[std::move(scheme)] = Entry{std::move(example), std::move(opener)};
}

Result<std::unique_ptr<Jig>> JigRegistry::open(std::string_view address, Env& env,
                                               Unit& unit) const {
  const std::size_t colon = address.find(':');
  const auto entry = entries_.find(address.substr(0, colon));
  if (colon == std::string_view::npos || entry == entries_.end()) {
    std::string examples = "manual";
    for (const auto& [scheme, known] : entries_) {
      examples += ", " + known.example;
    }
    return fail(ErrorCode::usage,
                fmt::format("'{}' is no jig this program can open", printable(address, 80)), {},
                "use one of: " + examples);
  }
  return entry->second.opener(address.substr(colon + 1), env, unit);
}

void register_hid_jig(JigRegistry& registry) {
  registry.add("hid", "hid:SERIAL",
               [](std::string_view rest, Env& env, Unit&) -> Result<std::unique_ptr<Jig>> {
                 DiscoveryFilter filter;
                 filter.product_ids = {kJigProductId};
                 filter.serial = rest;
                 SIXPOINT_ASSIGN(const AttachedDevice found, find_device(filter, env.clock));
                 Link link;
                 link.address = fmt::format("hid:{}", found.serial);
                 link.clock = borrow_clock(env.clock);
                 SIXPOINT_ASSIGN(link.reports, open_hid_transport(found.hidraw_node));
                 SIXPOINT_ASSIGN(auto jig, HidJig::open(std::move(link)));
                 return std::unique_ptr<Jig>(std::move(jig));
               });
}

}  // namespace sixpoint::device
