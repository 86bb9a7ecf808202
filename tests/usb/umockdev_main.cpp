// Runs the tests under umockdev's preload library. Exit code 77, and a line that names the package,
// where it is not installed.
#include <cstdio>

#include <gtest/gtest.h>

#include "mocks/umockdev_bus.h"

int main(int argc, char** argv) {
  if (const auto why = sixpoint::mocks::UmockdevBus::enter(argv); !why.empty()) {
    std::fprintf(stderr, "SKIPPED: %s\n", why.c_str());
    return 77;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
