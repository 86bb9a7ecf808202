// Every way to open a unit, whatever its protocol.
//
//   UnitRegistry registry(std::move(links), [](Link link) {
//     return WireUnit::open(std::move(link));  // wire/wire_unit.h
//   });
//   SIXPOINT_ASSIGN(const std::unique_ptr<Unit> unit, registry.open("hid:MOS2A45130007", env));
//
// A scheme of the TransportRegistry gives a link; the LinkOpener makes a Unit of it (the project's
// own protocol). A scheme that is added here makes its Unit itself: so a vendor's protocol is one
// line here and one folder (docs/devices/devices.md).
#pragma once

#include <functional>

#include "device/transport.h"
#include "device/unit.h"

namespace sixpoint::device {

class UnitRegistry {
 public:
  using Opener = std::function<Result<std::unique_ptr<Unit>>(std::string_view rest, Env& env)>;
  // Gets a link before the first transfer: to record what passes (session_recorder.h).
  using LinkWrapper = std::function<void(Link& link)>;

  using LinkOpener = std::function<Result<std::unique_ptr<Unit>>(Link link)>;

  UnitRegistry(TransportRegistry links, LinkOpener over_link)
      : links_(std::move(links)), over_link_(std::move(over_link)) {}

  // Goes before a link's scheme of the same name.
  void add(std::string scheme, std::string example, Opener opener) {
    openers_.add(std::move(scheme), std::move(example), std::move(opener));
  }
  // As TransportRegistry::open() and the LinkOpener; `env` outlives the unit.
  Result<std::unique_ptr<Unit>> open(std::string_view address, Env& env,
                                     const LinkWrapper& wrap = {}) const;
  std::vector<std::string> examples() const { return openers_.examples(links_.examples()); }
  const TransportRegistry& links() const { return links_; }

 private:
  TransportRegistry links_;
  LinkOpener over_link_;
  SchemeTable<Opener> openers_;
};

}  // namespace sixpoint::device
