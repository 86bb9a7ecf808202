// Runs the tests under umockdev's preload library. Exit code 77, and a line that names the package,
// where it is not installed.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "mocks/umockdev_bus.h"

int main(int argc, char** argv) {
  constexpr const char* kPreload = "libumockdev-preload.so.0";
  if (!sixpoint::mocks::UmockdevBus::missing().empty()) {
    if (::dlopen(kPreload, RTLD_LAZY) == nullptr) {
      std::fprintf(stderr, "SKIPPED: %s is missing; install the Debian package umockdev\n",
                   kPreload);
      return 77;
    }
    const char* before = std::getenv("LD_PRELOAD");
    const std::string preload = before == nullptr ? kPreload : std::string(before) + ":" + kPreload;
    ::setenv("LD_PRELOAD", preload.c_str(), 1);
    ::execv("/proc/self/exe", argv);
    std::perror("cannot start again under umockdev");
    return 70;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
