// The USB tests, for any carrier: each body uses gtest's assertions and leaves nothing plugged in.
#pragma once

#include <ostream>
#include <vector>

#include "usb/bench.h"

namespace sixpoint::tests {

struct UsbBody {
  const char* name;  // CamelCase, as a gtest name
  void (*run)(UsbBench& bench);
};

const std::vector<UsbBody>& usb_bodies();
// Fault plans (docs/faults.md): one body per kind of fault.
const std::vector<UsbBody>& usb_fault_bodies();

// For gtest, which would print the pointers.
inline void PrintTo(const UsbBody& body, std::ostream* out) { *out << body.name; }

}  // namespace sixpoint::tests
