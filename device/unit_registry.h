// Every way to open a unit, whatever it speaks.
//
// A scheme of the TransportRegistry leads to a link on which the project's own protocol is spoken
// (wire_unit.h). A scheme that is added here brings its own Unit: this is where a vendor's protocol
// joins, with one line and one folder (docs/devices/README.md).
#pragma once

#include "device/unit.h"

namespace sixpoint::device {

class UnitRegistry {
 public:
  using Opener = std::function<Result<std::unique_ptr<Unit>>(std::string_view rest, Env& env)>;
  // Gets a link before anything is said on it: to record what passes (session_recorder.h).
  using LinkWrapper = std::function<void(Link& link)>;

  explicit UnitRegistry(TransportRegistry links) : links_(std::move(links)) {}

  // Goes before a link's scheme of the same name.
  void add(std::string scheme, std::string example, Opener opener);
  // As TransportRegistry::open() and Unit::open(); `env` outlives the unit.
  Result<std::unique_ptr<Unit>> open(std::string_view address, Env& env,
                                     const LinkWrapper& wrap = {}) const;
  std::vector<std::string> examples() const;
  const TransportRegistry& links() const { return links_; }

 private:
  struct Entry {
    std::string example;
    Opener opener;
  };
  TransportRegistry links_;
  std::map<std::string, Entry, std::less<>> entries_;
};

}  // namespace sixpoint::device
