// A registry that knows virtual units and nothing else.
#pragma once

#include <utility>

#include "device/unit_registry.h"
#include "device/wire/wire_unit.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::tests {

inline device::UnitRegistry virtual_units() {
  device::TransportRegistry links;
  mocks::register_virtual(links);
  return {std::move(links),
          [](device::Link link) { return device::WireUnit::open(std::move(link)); }};
}

}  // namespace sixpoint::tests
