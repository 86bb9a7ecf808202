// The openers of addresses of the form "SCHEME:REST".
//
//   SchemeTable<UnitRegistry::Opener> table;
//   table.add("virtual", "virtual:seed=7", opener);
//   if (const auto found = table.find("virtual:seed=7")) {
//     found->opener(found->rest, env);
//   }
//
// What TransportRegistry, UnitRegistry and JigRegistry share. Const functions are safe from any
// thread.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sixpoint::device {

template <class Opener>
class SchemeTable {
 public:
  struct Found {
    const Opener& opener;
    std::string_view rest;  // into the address
  };

  // Replaces an opener of the same scheme. `example` is shown to people.
  void add(std::string scheme, std::string example, Opener opener) {
    entries_[std::move(scheme)] = {std::move(example), std::move(opener)};
  }
  // Empty where the address has no known scheme.
  std::optional<Found> find(std::string_view address) const {
    const std::size_t colon = address.find(':');
    const auto entry = entries_.find(address.substr(0, colon));
    if (colon == std::string_view::npos || entry == entries_.end()) {
      return std::nullopt;
    }
    return Found{entry->second.opener, address.substr(colon + 1)};
  }
  // In the order of the schemes, behind `first`.
  std::vector<std::string> examples(std::vector<std::string> first = {}) const {
    for (const auto& [scheme, entry] : entries_) {
      first.push_back(entry.example);
    }
    return first;
  }

 private:
  struct Entry {
    std::string example;
    Opener opener;
  };
  std::map<std::string, Entry, std::less<>> entries_;
};

}  // namespace sixpoint::device
